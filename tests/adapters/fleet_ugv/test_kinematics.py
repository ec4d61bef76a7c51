import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Refused, Vector3, Velocity
from fleet_ugv.kinematics import Ackermann, Differential
from fleet_ugv.model import AckermannCommand, Wheels

SPEEDS = st.floats(-5, 5)
BEAST = Differential(track=0.141, fastest=0.5)
WORN = Differential(track=0.141, fastest=0.5, left=0.8, right=1.1)
CAR = Ackermann(wheelbase=0.3, sharpest=0.5, fastest=1.0)


def velocity(speed, yaw_rate=0.0, side=0.0):
    return Velocity(Vector3(speed, side), yaw_rate)


@given(SPEEDS, SPEEDS)
def test_no_side_is_ever_asked_for_more_than_it_can_do(speed, yaw_rate):
    wheels = BEAST.inverse(velocity(speed, yaw_rate))
    assert max(abs(wheels.left), abs(wheels.right)) <= 0.5 + 1e-9


@given(st.floats(-0.2, 0.2), st.floats(-2, 2), st.sampled_from([BEAST, WORN]))
def test_forward_undoes_inverse_within_the_limits(speed, yaw_rate, base):
    back = base.forward(base.inverse(velocity(speed, yaw_rate)))
    assert back.linear.x == pytest.approx(speed, abs=1e-9)
    assert back.yaw_rate == pytest.approx(yaw_rate, abs=1e-9)


@given(st.floats(0.1, 5), SPEEDS, st.sampled_from([BEAST, WORN]))
def test_a_base_beyond_its_limits_keeps_to_its_curve(speed, yaw_rate, base):
    back = base.forward(base.inverse(velocity(speed, yaw_rate)))
    assert back.yaw_rate * speed == pytest.approx(yaw_rate * back.linear.x, abs=1e-6)


def test_a_left_turn_is_a_faster_right_side_and_a_sideways_part_is_dropped():
    assert BEAST.inverse(velocity(0.0, 1.0, side=1.0)) == Wheels(-0.0705, 0.0705)


@given(st.floats(0.05, 1.0), st.floats(-1, 1))
def test_a_car_does_what_it_is_asked_where_the_curve_is_wide_enough(speed, part):
    yaw_rate = part * speed * math.tan(0.5) / 0.3
    back = CAR.forward(CAR.inverse(velocity(speed, yaw_rate)))
    assert back.linear.x == pytest.approx(speed)
    assert back.yaw_rate == pytest.approx(yaw_rate, abs=1e-9)


@given(SPEEDS, SPEEDS)
def test_a_car_stays_within_its_limits_or_refuses(speed, yaw_rate):
    try:
        requested = CAR.inverse(velocity(speed, yaw_rate))
    except Refused:
        assert abs(speed) < 1e-5
    else:
        assert abs(requested.angle) <= 0.5
        assert abs(requested.speed) <= 1.0


def test_a_car_turns_left_with_wheels_to_the_left_and_backs_the_other_way_round():
    assert CAR.inverse(velocity(0.5, 0.2)).angle > 0
    assert CAR.inverse(velocity(-0.5, 0.2)).angle < 0
    assert CAR.inverse(velocity(0.0)) == AckermannCommand()


def test_a_car_tells_how_fast_it_must_roll_for_a_turn():
    slowest = CAR.slowest(1.0)
    assert CAR.inverse(velocity(slowest, 1.0)).angle == pytest.approx(0.5)


def test_a_car_cannot_turn_on_the_spot():
    with pytest.raises(Refused, match="on the spot"):
        CAR.inverse(velocity(0.0, 0.5))


@given(st.floats(-2, 2), st.floats(-3, 3))
def test_the_fastest_wheel_of_a_velocity_is_the_faster_side(speed, turn):
    base = Differential(0.4, 100.0)
    wheels = base.inverse(velocity(speed, turn))
    fastest = max(abs(wheels.left), abs(wheels.right))
    assert base.fastest_wheel(velocity(speed, turn)) == pytest.approx(fastest)
