"""The simulated gimbal: for the station in control, within its limits, and no faster than it can."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.onboard_sensors import OnboardSensors, reduce_sensors
from fleet_mavlink.payload_messages import GimbalDeviceAttitudeStatus
from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, CommandRequest
from fleet_mavlink.sim.gimbal import DEVICE, SimGimbal

NAN = math.nan


def request(*params, system=245, component=191):
    values = [*params, *([NAN] * (4 - len(params)))]
    return CommandRequest(1000, *values, 0.0, 0.0, 0.0, None, system, component)


@pytest.fixture
def gimbal():
    made = SimGimbal()
    assert made.configure(request(245.0, 191.0, -1.0, -1.0)) == ACCEPTED
    return made


def after(gimbal, seconds):
    for _ in range(round(seconds * 50)):
        gimbal.tick(0.02)
    return gimbal.pitch, gimbal.yaw


def test_nobody_turns_it_who_has_not_taken_control():
    gimbal = SimGimbal()
    assert gimbal.turn(request(-45.0, 0.0)) == DENIED
    assert after(gimbal, 2.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("ids", "result"), [((245, 191), ACCEPTED), ((245, 1), DENIED), ((255, 191), DENIED)]
)
def test_only_the_station_in_control_turns_it(gimbal, ids, result):
    assert gimbal.turn(request(-45.0, system=ids[0], component=ids[1])) == result


def test_control_is_taken_for_the_sender_for_given_ids_or_not_at_all(gimbal):
    other = {"system": 255, "component": 190}
    gimbal.configure(request(-1.0, 0.0, **other))  # leaves it
    assert gimbal.turn(request(1.0)) == ACCEPTED
    gimbal.configure(request(-2.0, **other))  # the sender
    assert gimbal.turn(request(1.0)) == DENIED
    assert gimbal.turn(request(1.0, **other)) == ACCEPTED
    gimbal.configure(request(0.0, 0.0, **other))  # nobody
    assert gimbal.turn(request(1.0, **other)) == DENIED


def test_it_turns_at_sixty_degrees_a_second_and_stays_there(gimbal):
    gimbal.turn(request(-45.0, 90.0))
    assert after(gimbal, 0.5) == pytest.approx((-30.0, 30.0))
    assert after(gimbal, 5.0) == pytest.approx((-45.0, 90.0))


def test_an_axis_without_a_number_goes_on_as_it_was(gimbal):
    gimbal.turn(request(NAN, NAN, -10.0, 20.0))
    gimbal.turn(request(NAN, 0.0))
    assert after(gimbal, 3.0) == pytest.approx((-30.0, 0.0))
    gimbal.turn(request(NAN, NAN, 0.0, NAN))
    assert after(gimbal, 3.0) == pytest.approx((-30.0, 0.0))


def test_a_rate_replaces_an_angle(gimbal):
    gimbal.turn(request(-45.0))
    after(gimbal, 0.5)
    gimbal.turn(request(NAN, NAN, 10.0))
    assert after(gimbal, 2.0) == pytest.approx((-10.0, 0.0))


def test_a_rate_goes_on_without_a_new_command_up_to_the_limit(gimbal):
    gimbal.turn(request(NAN, NAN, -20.0, 50.0))
    assert after(gimbal, 30.0) == (-90.0, 160.0)


@given(st.lists(st.tuples(*[st.floats(-500, 500) | st.just(NAN)] * 4), max_size=5))
def test_nothing_turns_it_beyond_its_limits_or_too_fast(commands):
    gimbal = SimGimbal()
    gimbal.configure(request(245.0, 191.0))
    for command in commands:
        gimbal.turn(request(*command))
        before = gimbal.pitch, gimbal.yaw
        gimbal.tick(0.1)
        assert abs(gimbal.pitch - before[0]) <= 6.0 + 1e-9
        assert -90.0 <= gimbal.pitch <= 30.0
        assert -160.0 <= gimbal.yaw <= 160.0


def test_it_tells_its_limits_in_radians(gimbal):
    told = gimbal.information(5000)
    limits = (told.pitch_min, told.pitch_max, told.yaw_min, told.yaw_max)
    assert tuple(map(math.degrees, limits)) == pytest.approx((-90.0, 30.0, -160.0, 160.0))
    assert (told.gimbal_device_id, told.time_boot_ms) == (DEVICE, 5000)


@given(st.floats(-89, 30), st.floats(-160, 160))
def test_its_attitude_is_read_as_it_is_turned(pitch, yaw):
    gimbal = SimGimbal()
    gimbal.pitch, gimbal.yaw = pitch, yaw
    (told,) = gimbal.due(1.0, 1000)
    read = reduce_sensors(OnboardSensors(), GimbalDeviceAttitudeStatus(told.flags, tuple(told.q)), 0.0).aim
    assert (read.pitch, read.yaw) == pytest.approx((pitch, yaw), abs=1e-3)


def test_its_attitude_comes_five_times_a_second(gimbal):
    assert sum(len(gimbal.due(step * 0.05, 0)) for step in range(200)) == pytest.approx(50, abs=8)
