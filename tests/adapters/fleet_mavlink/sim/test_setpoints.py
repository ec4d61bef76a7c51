"""Setpoints as a simulated autopilot understands them: what the mask leaves, and in whose axes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.flavour import VELOCITY_AND_YAW_RATE
from fleet_mavlink.sim.setpoints import setpoint_of, turned

LOCAL_NED = 1


def local(mask, position=(1.0, 2.0, 3.0), velocity=(4.0, 5.0, 6.0), yaw=0.7, rate=0.8):
    return setpoint_of(
        mav.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, LOCAL_NED, mask, *position, *velocity, 0, 0, 0, yaw, rate
        )
    )


def test_a_mask_of_zero_ignores_nothing():
    setpoint = local(0)
    assert (setpoint.frame, setpoint.position, setpoint.velocity) == (1, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert (setpoint.heading, setpoint.turn_rate, setpoint.force) == (0.7, 0.8, False)


@pytest.mark.parametrize(
    ("mask", "ignored"),
    [
        (0x007, {"position"}),
        (0x001, {"position"}),
        (0x038, {"velocity"}),
        (0x020, {"velocity"}),
        (0x400, {"heading"}),
        (0x800, {"turn_rate"}),
        (0x1C0, set()),  # accelerations, which nobody uses
        (VELOCITY_AND_YAW_RATE, {"position", "heading"}),
        (0xFFF, {"position", "velocity", "heading", "turn_rate"}),
    ],
)
def test_what_the_mask_names_is_ignored(mask, ignored):
    setpoint = local(mask)
    fields = ("position", "velocity", "heading", "turn_rate")
    assert {name for name in fields if getattr(setpoint, name) is None} == ignored


def test_a_force_is_marked():
    assert local(0x200).force


def test_a_global_position_is_in_degrees_and_metres():
    message = mav.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, 0xDF8, 473977421, -85455941, 15.0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    setpoint = setpoint_of(message)
    assert (setpoint.frame, setpoint.position) == (6, pytest.approx((47.3977421, -8.5455941, 15.0)))
    assert (setpoint.velocity, setpoint.heading, setpoint.turn_rate) == (None, None, None)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_counts_only_where_it_is_used(number):
    vectors = {"position": (0.0, number, 0.0)}, {"velocity": (0.0, 0.0, number)}
    for part in (*vectors, {"yaw": number}, {"rate": number}):
        assert not local(0, **part).finite
        assert local(0xFFF, **part).finite
    assert local(0).finite


@pytest.mark.parametrize(("speed", "finite"), [(1e3, True), (-1e3, True), (1000.1, False), (-1e9, False)])
def test_a_speed_beyond_a_kilometre_a_second_is_none(speed, finite):
    assert local(0, velocity=(0.0, speed, 0.0)).finite is finite


def test_a_body_vector_is_turned_by_the_heading():
    assert turned((1.0, 0.0, 2.0), 0.0) == (1.0, 0.0, 2.0)
    assert turned((1.0, 0.0, 2.0), math.pi / 2) == pytest.approx((0.0, 1.0, 2.0))
    assert turned((0.0, 1.0, 2.0), math.pi / 2) == pytest.approx((-1.0, 0.0, 2.0))


@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(-7, 7))
def test_turning_keeps_the_length_and_is_undone_by_its_opposite(x, y, heading):
    there = turned((x, y, 1.0), heading)
    assert math.hypot(*there) == pytest.approx(math.hypot(x, y, 1.0))
    assert turned(there, -heading) == pytest.approx((x, y, 1.0), abs=1e-9)
