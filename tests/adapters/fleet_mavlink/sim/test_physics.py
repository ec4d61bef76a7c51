"""A simulated body in the air: limited acceleration, wind, gravity, and the ground."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.sim.physics import GRAVITY, Agility, Body, MotionTarget, approach

AGILITY = Agility(across=4.0, along=2.0, turn=1.5)
CALM = (0.0, 0.0)
DT = 0.02


def flown(aim, seconds, *, body=None, wind=CALM):
    body = body or Body(down=-10.0)
    for _ in range(round(seconds / DT)):
        body.advance(aim, AGILITY, wind, DT)
    return body


def test_it_gains_speed_no_faster_than_it_can_and_then_keeps_it():
    body = flown(MotionTarget(vn=3.0, ve=4.0), 1.0)
    assert body.speed == pytest.approx(4.0)
    assert math.atan2(body.ve, body.vn) == pytest.approx(math.atan2(4.0, 3.0)), "straight towards it"
    assert flown(MotionTarget(vn=3.0, ve=4.0), 1.0, body=body).speed == pytest.approx(5.0)


def test_it_climbs_within_its_own_limit_and_up_is_negative():
    body = flown(MotionTarget(vd=-3.0), 1.0)
    assert (body.vd, body.height) == (pytest.approx(-2.0), pytest.approx(11.0, abs=0.05))


def test_where_it_is_is_its_velocity_over_time():
    body = flown(MotionTarget(vn=2.0), 10.0)
    assert body.north == pytest.approx(2.0 * 10.0 - 2.0**2 / (2 * 4.0), abs=0.05)
    assert (body.east, body.down) == (0.0, -10.0)


def test_wind_moves_it_without_a_speed_of_its_own():
    body = flown(MotionTarget(), 5.0, wind=(1.0, -2.0))
    assert (body.north, body.east, body.speed) == (pytest.approx(5.0), pytest.approx(-10.0), 0.0)


def test_without_thrust_it_falls_and_rests_on_the_ground():
    body = flown(MotionTarget(thrust=False), 1.0)
    assert body.vd == pytest.approx(GRAVITY)
    assert body.height == pytest.approx(10.0 - GRAVITY / 2, abs=0.15)
    body = flown(MotionTarget(thrust=False), 2.0, body=body)
    assert (body.down, body.vd, body.grounded) == (0.0, 0.0, True)


def test_on_the_ground_nothing_moves_it_but_a_climb():
    body = flown(MotionTarget(vn=5.0, vd=0.5), 2.0, body=Body(), wind=(3.0, 0.0))
    assert (body.north, body.speed, body.grounded) == (0.0, 0.0, True)
    assert not flown(MotionTarget(vd=-1.0), 1.0, body=body).grounded


@given(st.floats(0.0, math.tau), st.floats(0.0, math.tau))
def test_it_turns_to_a_heading_the_shorter_way_and_within_its_rate(start, wanted):
    body = Body(down=-10.0, heading=start)
    left = abs(math.remainder(wanted - start, math.tau))
    for _ in range(10):
        body.advance(MotionTarget(heading=wanted), AGILITY, CALM, DT)
        assert abs(body.turn_rate) <= AGILITY.turn
        assert 0.0 <= body.heading <= math.tau
    assert abs(math.remainder(wanted - body.heading, math.tau)) <= left + 1e-9


def test_a_turn_rate_to_the_right_is_positive_and_limited():
    assert flown(MotionTarget(turn_rate=0.5), 1.0).heading == pytest.approx(0.5)
    assert flown(MotionTarget(turn_rate=9.0), 1.0).heading == pytest.approx(1.5)
    assert flown(MotionTarget(turn_rate=-0.5), 1.0).heading == pytest.approx(math.tau - 0.5)


@pytest.mark.parametrize(
    ("aim", "heading", "roll", "pitch"),
    [
        (MotionTarget(vn=9.0), 0.0, 0, -1),
        (MotionTarget(vn=-9.0), 0.0, 0, 1),
        (MotionTarget(ve=9.0), 0.0, 1, 0),
        (MotionTarget(ve=9.0), math.pi / 2, 0, -1),
        (MotionTarget(vn=9.0), math.pi / 2, -1, 0),
    ],
)
def test_it_leans_towards_where_it_accelerates(aim, heading, roll, pitch):
    lean = math.atan2(AGILITY.across, GRAVITY)
    body = flown(aim, DT, body=Body(down=-10.0, heading=heading))
    assert (body.roll, body.pitch) == (pytest.approx(roll * lean), pytest.approx(pitch * lean))


@given(st.floats(0.0, 500.0), st.floats(0.1, 30.0), st.floats(0.5, 10.0))
def test_an_approach_ends_in_a_standstill_where_it_should(distance, speed, acceleration):
    now = approach(distance, speed, acceleration)
    assert 0.0 <= now <= speed
    assert now * now / (2 * acceleration) <= distance, "it stops in time"
