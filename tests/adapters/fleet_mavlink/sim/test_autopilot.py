"""What both simulated autopilots have in common: modes and motors, the passing of time, and its place."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import accept
from fleet_mavlink.sim.manoeuvres import Idle
from fleet_mavlink.sim.missions import ACTIVE, NOT_STARTED, PAUSED

ACCEPTED, UNSUPPORTED = 0, 3


@pytest.fixture(params=["ardupilot", "px4"])
def it(request, bench):
    made = bench(request.param)
    made.run(0.2)
    return made


@pytest.fixture
def flying(it):
    it.climb()
    return it


def test_a_command_that_nobody_handles_is_answered_as_unsupported(it):
    assert it.requests(31_999) == [UNSUPPORTED]


def test_a_command_that_changes_nothing_here_is_accepted(it):
    assert it.requests(mav.MAV_CMD_DO_SET_ROI_NONE) == [ACCEPTED]
    assert accept(it.pilot, None) == ACCEPTED


def test_motors_that_are_off_are_idle_in_every_mode(it):
    it.pilot.enter(it.pilot.modes["RTL"])
    assert type(it.pilot.manoeuvre) is Idle
    it.run(3.0)
    assert it.height == 0.0


def test_arming_sets_home_where_it_stands_and_starts_its_clock(it):
    it.body.north = 5.0
    it.pilot.arm()
    assert it.pilot.home.ned()[0] == pytest.approx(5.0, abs=0.01)
    assert it.pilot.armed_at == it.pilot.time
    assert it.pilot.armed


def test_motors_that_are_stopped_in_the_air_let_it_fall(flying):
    flying.pilot.disarm()
    assert type(flying.pilot.manoeuvre) is Idle
    assert flying.until(lambda: flying.body.grounded, 3.0) == pytest.approx(math.sqrt(2 * 10 / 9.81), abs=0.2)


def test_a_pilot_who_takes_over_holds_it_where_braking_ends(flying):
    flying.body.vn = 4.0
    mode = flying.pilot.modes["LOITER" if flying.ardupilot else "POSCTL"]
    flying.pilot.pilot_takes_over(mode)
    flying.run(5.0)
    assert flying.mode == mode.name
    assert flying.body.north == pytest.approx(4.0**2 / 5.0, abs=0.5)
    assert flying.height == pytest.approx(10.0, abs=0.4)


def test_leaving_the_mode_of_a_mission_pauses_it_and_disarmed_it_has_not_started(it):
    pilot = it.pilot
    name = "AUTO" if it.ardupilot else "MISSION"
    for armed, state in ((True, PAUSED), (False, NOT_STARTED)):
        pilot.mode, pilot.armed, pilot.missions.state = pilot.modes[name], armed, ACTIVE
        assert pilot.runs_mission
        pilot.enter(pilot.modes["RTL"])
        assert pilot.missions.state == state
        assert not pilot.runs_mission


def test_it_takes_off_until_it_is_at_its_height(it):
    states = []
    if it.ardupilot:
        it.set_mode("GUIDED")
        it.requests(400, 1)
        it.requests(22, 0, 0, 0, 0, 0, 0, 5)
    else:
        it.requests(22, math.nan, 0, 0, math.nan, math.nan, math.nan, 493)
        it.requests(400, 1)
    for _ in range(100):
        it.run(0.2)
        states.append(it.pilot.taking_off)
    assert states[0] is True
    assert states[-1] is False
    assert sorted(states, reverse=True) == states  # it ends once


def test_wind_moves_it_in_the_air_only(flying, bench):
    ground = bench("ardupilot" if flying.ardupilot else "px4", faults={"wind": 20.0})
    ground.run(5.0)
    assert (ground.body.north, ground.body.east) == (0.0, 0.0)
    before = flying.body.east
    flying.vehicle.set_fault("wind", 20.0)
    flying.run(5.0)
    assert abs(flying.body.east - before) > 0.5


def test_a_battery_empties_much_faster_in_the_air(flying, bench):
    used = []
    for each in (bench("ardupilot" if flying.ardupilot else "px4"), flying):
        before = each.pilot.battery.percent
        each.run(20.0)
        used.append(before - each.pilot.battery.percent)
    assert 0.0 < used[0] < 0.2
    assert used[1] > 5 * used[0]


def test_motors_that_only_idle_need_as_little_as_motors_that_are_off(it):
    before = it.pilot.battery.percent
    it.pilot.arm()
    it.run(8.0)
    assert it.pilot.armed
    assert before - it.pilot.battery.percent < 0.1


def test_its_place_is_where_its_body_is_and_may_be_asked_for_beside_it(it):
    it.body.north, it.body.east = 111.195, 0.0
    latitude, longitude, altitude = it.pilot.geo()
    assert latitude == pytest.approx(47.397742 + 0.001, abs=1e-5)
    assert (longitude, altitude) == pytest.approx((8.545594, 488.0), abs=0.7)
    assert it.pilot.geo(off_east=75.27)[1] == pytest.approx(8.545594 + 0.001, abs=1e-5)


def test_faults_take_its_remote_control_and_its_position_on_the_ground(it):
    assert it.pilot.has_position
    it.vehicle.set_fault("rc_loss", 1)
    it.vehicle.set_fault("not_ready", 1)
    assert (it.pilot.remote_control, it.pilot.has_position) == (False, False)
    it.pilot.armed = True
    assert it.pilot.has_position


@pytest.mark.parametrize("seconds", [4.0, 20.0])
def test_it_has_a_position_after_the_time_that_a_test_gives_it(bench, seconds):
    for flavour in ("ardupilot", "px4"):
        it = bench(flavour, ready_after=seconds)
        assert it.until(lambda it=it: it.pilot.has_position, 40.0) == pytest.approx(seconds, abs=0.6)


def test_it_is_silent_in_the_first_second_of_its_start(bench):
    for flavour in ("ardupilot", "px4"):
        it = bench(flavour, ready_after=None)
        it.gcs = False
        it.run(0.9)
        assert not it.said("HEARTBEAT")
        it.run(1.5)
        assert it.said("HEARTBEAT")
