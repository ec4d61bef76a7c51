"""What every moved vehicle has unless its autopilot differs: setpoints, speeds, holds, and arming."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Vector3, Velocity
from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_plane import ArduPlane
from fleet_mavlink.ardupilot_rover import ArduRover
from fleet_mavlink.flavour import arm_command, ned_setpoint
from fleet_mavlink.messages import CommandLong, Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState

ARDUPILOT, PX4, ROVER, PLANE = ArduCopter(), Px4(), ArduRover(), ArduPlane()


def test_forcing_skips_the_checks_of_what_is_asked_and_of_nothing_else():
    assert arm_command(arm=True, force=True) == CommandLong(400, param1=1.0, param2=21196.0)
    assert arm_command(arm=True, force=False) == CommandLong(400, param1=1.0, param2=0.0)
    assert arm_command(arm=False, force=True) == CommandLong(400, param1=0.0, param2=21196.0)


@pytest.mark.parametrize(
    ("heading", "north", "east"), [(0.0, 1, 0), (math.pi / 2, 0, 1), (math.pi, -1, 0), (-math.pi / 2, 0, -1)]
)
def test_forward_is_where_the_nose_points(heading, north, east):
    sent = Px4().setpoint(Velocity(Vector3(1.0, 0.0, 0.0)), heading, 1)
    assert (sent.vx, sent.vy, sent.vz) == pytest.approx((north, east, 0.0), abs=1e-9)


def test_left_up_and_turning_left_have_their_signs():
    sent = Px4().setpoint(Velocity(Vector3(0.0, 1.0, 2.0), yaw_rate=0.5), 0.0, 3)
    assert (sent.vx, sent.vy, sent.vz) == pytest.approx((0.0, -1.0, -2.0), abs=1e-9)
    assert sent.yaw_rate == -0.5
    assert (sent.coordinate_frame, sent.type_mask, sent.target_system) == (1, 1479, 3)


small = st.floats(-20, 20)


@given(small, small, small, st.floats(-math.pi, math.pi))
def test_turning_a_velocity_changes_no_speed(x, y, z, heading):
    sent = Px4().setpoint(Velocity(Vector3(x, y, z)), heading, 1)
    assert math.hypot(sent.vx, sent.vy) == pytest.approx(math.hypot(x, y), abs=1e-9)
    assert sent.vz == -z


def test_only_velocity_and_yaw_rate_of_a_setpoint_count_and_it_is_for_the_autopilot():
    sent = ned_setpoint(Vector3(1.0, -2.0, 3.0), 0.25, 7)
    assert (sent.vx, sent.vy, sent.vz, sent.yaw_rate) == (1.0, -2.0, 3.0, 0.25)
    assert (sent.target_system, sent.target_component, sent.coordinate_frame) == (7, 1, 1)
    used = {3, 4, 5, 11}  # bits of POSITION_TARGET_TYPEMASK: vx, vy, vz, yaw rate
    assert {bit for bit in range(12) if not sent.type_mask >> bit & 1} == used | {9}  # 9: force, not a field


@pytest.mark.parametrize(
    ("limit", "wanted", "speed"),
    [
        (5.0, None, 5.0),
        (5.0, 3.0, 3.0),
        (5.0, 9.0, 5.0),
        (None, 3.0, 3.0),
        (None, None, math.inf),
        (5.0, 0.01, 0.2),  # slower, an autopilot does not arrive
        (0.1, None, 0.2),
    ],
)
def test_a_goal_is_flown_at_what_is_asked_for_within_the_limit_and_not_slower_than_it_can(
    limit, wanted, speed
):
    for metres in (0.0, 1e6):
        assert ARDUPILOT.speed_to(VehicleState(), limit, wanted, metres) == speed


@given(st.none() | st.floats(0.01, 50), st.none() | st.floats(0.01, 50))
def test_no_speed_exceeds_the_limit_beyond_the_slowest(limit, wanted):
    speed = PX4.speed_to(VehicleState(), limit, wanted, 10.0)
    assert 0.2 <= speed <= max(0.2, limit or math.inf)


@pytest.mark.parametrize(("flavour", "mode"), [(ARDUPILOT, "BRAKE"), (PX4, "AUTO.LOITER")])
def test_it_is_held_by_its_hold(flavour, mode):
    brake = flavour.holding(VehicleState())
    assert (brake.mode, brake.request) == (mode, flavour.hold_command(VehicleState()))


def test_one_that_tries_its_brakes_is_held_by_the_first_of_them():
    class Tries(ArduCopter):
        tries_brakes = True
        braking = ("LOITER", "BRAKE")

    class TriesNone(Tries):
        braking = ()

    assert Tries().holding(VehicleState()).mode == "LOITER"
    assert TriesNone().holding(VehicleState()).mode == "BRAKE"


@pytest.mark.parametrize("custom_mode", [9, 6, 4, 5, 17, 3])
def test_it_comes_down_in_a_landing_and_on_its_way_home(custom_mode):
    state = VehicleState(heartbeat=Heartbeat(2, 3, 0x80, custom_mode))
    assert ARDUPILOT.comes_down(state) is (custom_mode in {9, 6})
    assert not ARDUPILOT.comes_down(VehicleState())


def test_a_mode_is_ours_if_only_we_move_it_there():
    assert PX4.ours == {"OFFBOARD", "AUTO.LOITER", "AUTO.TAKEOFF"}
    assert not {ARDUPILOT.land, ARDUPILOT.return_home, ARDUPILOT.mission} & ARDUPILOT.ours


def test_only_what_stays_on_the_surface_or_circles_is_at_home_without_landing():
    assert (ROVER.hovers_at_home, PLANE.hovers_at_home) == (True, True)
    assert (ARDUPILOT.hovers_at_home, PX4.hovers_at_home) == (False, False)


def test_a_multirotor_moves_in_any_direction_and_needs_no_parameters_for_it():
    sideways = Velocity(Vector3(0.0, 1.0, -1.0), yaw_rate=1.0)
    for flavour in (ARDUPILOT, PX4):
        assert flavour.cannot(sideways, turns_in_place=None) == ""
        assert flavour.settings == ()
        assert flavour.flavour is flavour
        assert flavour.failsafe_table == flavour.name


def test_it_lands_by_its_mode():
    assert ARDUPILOT.land_command() == ARDUPILOT.mode_command("LAND")


def test_arming_and_disarming_are_told_apart_by_one_parameter():
    assert [arm_command(arm=arm, force=False).param1 for arm in (True, False)] == [1.0, 0.0]
