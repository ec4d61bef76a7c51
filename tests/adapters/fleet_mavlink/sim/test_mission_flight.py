"""The flight of a stored mission, item by item, on both flavours."""

import math

import pytest

from fleet_mavlink.sim.mission_flight import MissionManoeuvre, place_of_item
from fleet_mavlink.sim.mission_items import Item
from fleet_mavlink.sim.missions import ACTIVE, COMPLETE, PAUSED
from tests.adapters.fleet_mavlink.sim.mission_plans import LAT, LON, item, plan, start, upload


def test_a_mission_is_flown_to_its_end(loaded):
    start(loaded)
    assert loaded.pilot.missions.state == ACTIVE
    loaded.until(lambda: loaded.pilot.missions.state == COMPLETE, 120)
    loaded.until(lambda: not loaded.pilot.armed)
    reached = {m.seq for m in loaded.said("MISSION_ITEM_REACHED")}
    first = 1 if loaded.ardupilot else 0
    assert reached == {first, first + 1, first + 2, first + 3}
    assert loaded.body.east == pytest.approx(15, abs=1.5)


def test_the_current_item_never_passes_the_count(loaded):
    start(loaded)
    loaded.until(lambda: loaded.pilot.missions.state == COMPLETE, 120)
    loaded.run(5)
    loaded.requests(512, 42)
    current = loaded.last("MISSION_CURRENT")
    assert current.seq == len(plan(ardupilot=loaded.ardupilot)) - 1
    assert current.mission_state == COMPLETE


def test_leaving_the_mode_pauses_and_coming_back_goes_on(loaded):
    start(loaded)
    loaded.until(lambda: loaded.pilot.missions.current == (2 if loaded.ardupilot else 1), 40)
    loaded.set_mode("GUIDED" if loaded.ardupilot else "LOITER")
    assert loaded.pilot.missions.state == PAUSED
    current = loaded.pilot.missions.current
    loaded.set_mode("AUTO" if loaded.ardupilot else "MISSION")
    assert (loaded.pilot.missions.state, loaded.pilot.missions.current) == (ACTIVE, current)


def test_a_mission_that_asks_for_rtl_returns(bench):
    px4 = bench("px4")
    upload(px4, [item(0, 22), item(1, 16, east=1000), item(2, 20)])
    start(px4)
    px4.until(lambda: px4.mode == "RTL", 60)


def test_the_end_of_the_last_item_is_reported_once_by_ardupilot_and_again_by_px4(loaded):
    start(loaded)
    loaded.until(lambda: loaded.pilot.missions.state == COMPLETE, 120)
    loaded.heard.clear()
    loaded.run(3.5)
    reached = [each.seq for each in loaded.said("MISSION_ITEM_REACHED")]
    assert reached == ([] if loaded.ardupilot else [len(loaded.pilot.missions.items) - 1] * 3)
    loaded.run(30)
    assert len(loaded.said("MISSION_ITEM_REACHED")) <= 10


ZEROS = (0.0, 0.0, 0.0, 0.0)


def there(north, command=16, *, p1=0.0, p2=0.0, p3=0.0, p4=0.0, z=10.0, frame=3):
    return Item(frame, command, 1, p1, p2, p3, p4, LAT + round(north / 111_195 * 1e7), LON, z)


@pytest.fixture
def flying(bench):
    """Let an ArduCopter fly at 10 m, on which missions of a test's own are put."""
    it = bench("ardupilot")
    it.climb()
    return it


def begins(it, *items):
    """Let it begin a mission; item 0 is home."""
    it.pilot.missions._plans[0] = [Item(0, 16, 1, *ZEROS, 0, 0, 0.0), *items]
    assert it.set_mode("AUTO") == [0]


def reached(it):
    return [message.seq for message in it.said("MISSION_ITEM_REACHED")]


@pytest.mark.parametrize(("frame", "z"), [(3, 15.0), (6, 15.0), (10, 15.0), (0, 503.0), (5, 503.0)])
def test_a_height_is_above_home_or_above_the_sea_by_its_frame(flying, frame, z):
    _, _, down = place_of_item(flying.pilot, there(0.0, z=z, frame=frame))
    assert down == pytest.approx(-15.0, abs=0.1)


def test_an_item_without_a_place_is_where_the_vehicle_is(flying):
    flying.body.north, flying.body.east = 30.0, -20.0
    north, east, down = place_of_item(flying.pilot, Item(3, 22, 1, *ZEROS, 0, 0, 12.0))
    assert (north, east, down) == pytest.approx((30.0, -20.0, -12.0), abs=0.1)


@pytest.mark.parametrize("command", [16, 19])
def test_a_stay_is_as_long_as_its_item_says(flying, command):
    begins(flying, there(10.0, command, p1=5.0), there(20.0))
    flying.until(lambda: flying.body.north > 9.6)
    assert flying.until(lambda: reached(flying) == [1]) == pytest.approx(5.0, abs=0.6)


def test_a_delay_stays_where_it_is(flying):
    begins(flying, Item(3, 93, 1, 4.0, 0.0, 0.0, 0.0, 0, 0, 0.0), there(20.0))
    flying.run(3.5)
    assert flying.body.north == pytest.approx(0.0, abs=0.5)
    assert reached(flying) == []
    flying.until(lambda: reached(flying) == [1], 2.0)


def test_a_stay_without_an_end_is_never_reached(flying):
    begins(flying, there(5.0, 17), there(20.0))
    flying.run(20.0)
    assert reached(flying) == []
    assert flying.body.north == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(("radius", "direction"), [(8.0, 1), (-8.0, -1), (0.0, 1)])
def test_a_circle_has_its_turns_its_radius_and_its_direction(flying, radius, direction):
    begins(flying, there(30.0, 18, p1=1.0, p3=radius), there(30.0))
    away = abs(radius) or 10.0
    flying.until(lambda: flying.body.north > 29.0 + away)  # it enters the circle in the north
    turned, before = 0.0, None
    while not reached(flying):
        flying.run(0.1)
        seen = math.atan2(flying.body.east, flying.body.north - 30.0)
        turned += 0.0 if before is None else math.remainder(seen - before, math.tau)
        before = seen
        assert math.hypot(flying.body.north - 30.0, flying.body.east) < away + 1.5
    assert turned == pytest.approx(direction * math.tau, abs=0.9)


def test_a_speed_is_that_of_what_follows_and_a_change_is_done_at_once(flying):
    begins(flying, Item(3, 178, 1, 1.0, 2.0, -1.0, 0.0, 0, 0, 0.0), there(60.0))
    flying.run(4.0)
    assert reached(flying) == [1]
    assert flying.body.speed == pytest.approx(2.0, abs=0.1)


def test_an_item_turns_the_nose_to_its_heading_unless_it_is_zero_or_no_number(flying):
    begins(flying, there(60.0, p4=90.0))
    flying.run(4.0)
    assert math.degrees(flying.body.heading) == pytest.approx(90.0, abs=3.0)
    for nothing in (0.0, math.nan):
        begins_again = there(60.0, p4=nothing)
        assert MissionManoeuvre.manoeuvres[16](flying.pilot, begins_again).heading is None


def test_it_lands_over_the_items_place(flying):
    begins(flying, there(15.0, 21))
    flying.until(lambda: not flying.pilot.armed, 60.0)
    assert (flying.body.north, flying.height) == (pytest.approx(15.0, abs=0.7), 0.0)


def test_a_mission_that_is_cleared_or_jumped_in_goes_on_from_there(flying):
    begins(flying, there(60.0), there(0.0), there(20.0))
    flying.run(1.0)
    assert flying.requests(224, 3) == [0]
    flying.run(0.2)
    flying.until(lambda: reached(flying) == [3], 30.0)
    assert flying.body.north == pytest.approx(20.0, abs=0.7)
