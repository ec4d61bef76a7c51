"""The flight of a stored mission, item by item, on both flavours."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.missions import ACTIVE, COMPLETE, PAUSED

LAT, LON = 473977420, 85455940


def item(seq, command, *, east=0, height=10.0, frame=6, p1=0.0):
    x, y = (LAT, LON + east) if command in {16, 21} else (0, 0)
    return mav.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, p1, 0, 0, 0, x, y, height, 0)


def plan(ardupilot):
    """Take off, two waypoints, land; ArduPilot's item 0 is home."""
    flown = [(22, 0), (16, 1000), (16, 2000), (21, 2000)]
    first = [item(0, 16, frame=0)] if ardupilot else []
    return first + [item(len(first) + n, command, east=east) for n, (command, east) in enumerate(flown)]


def upload(bench, items):
    bench.run(0.2)
    answers = bench.tell(mav.MAVLink_mission_count_message(1, 1, len(items), 0))
    requested = "MISSION_REQUEST" if bench.ardupilot else "MISSION_REQUEST_INT"
    for seq, message in enumerate(items):
        assert [(m.get_type(), m.seq) for m in answers] == [(requested, seq)]
        answers = bench.tell(message)
    assert [(m.get_type(), m.type) for m in answers] == [("MISSION_ACK", 0)]


@pytest.fixture(params=["ardupilot", "px4"])
def loaded(request, bench):
    made = bench(request.param)
    upload(made, plan(made.ardupilot))
    return made


def start(bench):
    if bench.ardupilot:
        bench.set_mode("GUIDED")
        assert bench.requests(400, 1) == [0]
    assert bench.requests(300) == [0]


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
    assert current.seq == len(plan(loaded.ardupilot)) - 1
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
