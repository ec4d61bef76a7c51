"""GUIDED of ArduCopter, as it was seen on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

HOLD_HEADING, NOSE_FREE = 0x5C7, 0xDC7
ACCEPTED = 0


@pytest.fixture
def flying(ap):
    ap.climb()
    return ap


@pytest.mark.parametrize(("frame", "north", "east"), [(1, 4, 0), (7, 4, 0), (8, 0, 4), (9, 0, 4), (12, 0, 0)])
def test_velocity_frames(bench, frame, north, east):
    ap = bench("ardupilot", home=(47.0, 8.0, 400.0, 90.0))
    ap.climb()
    ap.stream(4, 1.0, frame=frame)
    assert ap.body.north == pytest.approx(north, abs=0.7)
    assert ap.body.east == pytest.approx(east, abs=0.7)


def test_a_strafe_with_the_yaw_rate_held_keeps_the_heading(flying):
    flying.stream(4, 0.0, 1.0, mask=HOLD_HEADING)
    assert flying.body.east == pytest.approx(4, abs=0.7)
    assert flying.body.heading == pytest.approx(0, abs=0.01)


def test_a_strafe_without_yaw_chases_its_own_nose(flying):
    flying.stream(4, 0.0, 1.0, mask=NOSE_FREE)
    assert abs(math.remainder(flying.body.heading, math.tau)) > 0.8
    assert flying.body.east < 3.0


def test_wp_yaw_behavior_0_keeps_the_nose(flying):
    flying.set_param("WP_YAW_BEHAVIOR", 0)
    flying.stream(2, 0.0, 1.0, mask=NOSE_FREE)
    assert flying.body.heading == pytest.approx(0, abs=0.01)


def test_yaw_in_a_body_frame_counts_from_the_nose_at_every_message(flying):
    flying.stream(4, 0.0, mask=0x9C7, yaw=0.5)
    assert math.degrees(flying.body.heading) > 90


def test_the_last_velocity_is_held_for_3_seconds(flying):
    flying.drive(2.0, 0.0, 0.0)
    flying.run(2.9)
    assert flying.body.speed == pytest.approx(2.0, abs=0.05)
    flying.run(1.5)
    assert flying.body.speed == pytest.approx(0.0, abs=0.05)
    assert flying.mode == "GUIDED"


def test_speed_and_acceleration_are_limited(flying):
    flying.stream(1, 20.0)
    assert flying.body.speed == pytest.approx(2.5, abs=0.3)
    flying.stream(5, 20.0)
    assert flying.body.speed == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize("speed", [math.nan, 5000.0])
def test_insane_numbers_stop_the_vehicle(flying, speed):
    flying.stream(2, 2.0)
    flying.stream(2, speed)
    assert flying.body.speed < 0.05


def test_the_force_bit_stops_the_vehicle(flying):
    flying.stream(2, 2.0, mask=0x7C7)
    assert flying.body.speed < 0.05


def test_setpoints_outside_guided_are_ignored(flying):
    flying.set_mode("BRAKE")
    flying.stream(2, 2.0)
    assert flying.body.speed < 0.05


def test_a_setpoint_for_another_system_is_ignored_and_for_all_is_obeyed(flying):
    for system, moves in ((7, False), (0, True)):
        flying.tell(
            mav.MAVLink_set_position_target_local_ned_message(
                0, system, 1, 1, 0x5C7, 0, 0, 0, 2.0, 0, 0, 0, 0, 0, 0, 0
            )
        )
        flying.run(1)
        assert (flying.body.speed > 0.5) is moves


def test_a_global_target_above_home_is_reached(flying):
    flying.tell(
        mav.MAVLink_set_position_target_global_int_message(
            0, 1, 1, 6, 3576, 473979420, 85455940, 15.0, 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    flying.until(lambda: abs(flying.body.north - 22.2) < 0.6 and abs(flying.height - 15) < 0.5)


@pytest.mark.parametrize("moves", ["velocity", "place"])
def test_a_setpoint_before_it_leaves_the_ground_ends_a_takeoff(ap, moves):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert ap.requests(22, 0, 0, 0, 0, 0, 0, 5) == [ACCEPTED]
    if moves == "velocity":
        ap.drive(1.0, 0.0, 0.0)
    else:
        ap.tell(
            mav.MAVLink_set_position_target_global_int_message(
                0, 1, 1, 6, 3576, 473979420, 85455940, 15.0, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )
    ap.run(8)
    assert ap.body.grounded
