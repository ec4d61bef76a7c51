"""A simulated rover: it drives along its nose, brakes or coasts, and turns as its wheels let it."""

import math

import pytest

from fleet_mavlink.sim.physics import Agility, MotionTarget
from fleet_mavlink.sim.rover_physics import WheeledBody

AGILITY = Agility(across=2.0, along=0.0, turn=1.0)
DT = 0.02
NORTH = MotionTarget(vn=3.0)


def driven(aim, seconds, body=None, **more):
    body = body or WheeledBody(**more)
    for _ in range(round(seconds / DT)):
        body.advance(aim, AGILITY, (0.0, 0.0), DT)
    return body


def test_it_gains_speed_no_faster_than_it_can():
    assert driven(NORTH, 1.0).along == pytest.approx(2.0)
    body = driven(NORTH, 3.0)
    assert (body.along, body.vn, body.ve) == (pytest.approx(3.0), pytest.approx(3.0), 0.0)
    assert body.north == pytest.approx(3.0 * 3.0 - 3.0**2 / (2 * 2.0), abs=0.05)


def test_it_brakes_as_hard_as_it_can_or_coasts():
    moving = driven(NORTH, 3.0)
    assert driven(MotionTarget(), 1.0, moving).along == pytest.approx(1.0)
    assert driven(MotionTarget(), 1.0, moving).along == pytest.approx(0.0, abs=1e-9)
    coasting = driven(NORTH, 3.0, easing=2.0)
    assert driven(MotionTarget(), 2.0, coasting).along == pytest.approx(3.0 / math.e)


def test_a_course_aside_is_turned_to_along_the_nose():
    body = driven(MotionTarget(ve=3.0), 5.0)
    assert body.heading == pytest.approx(math.pi / 2, abs=0.01)
    assert (body.vn, body.ve) == (pytest.approx(0.0, abs=0.05), pytest.approx(3.0, abs=0.05))


def test_backwards_its_nose_points_away_from_its_course():
    body = driven(NORTH, 3.0, backwards=True, heading=math.pi)
    assert (body.along, body.vn) == (pytest.approx(-3.0), pytest.approx(3.0))
    assert body.heading == pytest.approx(math.pi)


@pytest.mark.parametrize(("skid", "turned"), [(False, 0.0), (True, 0.5)])
def test_only_one_without_steered_wheels_turns_where_it_stands(skid, turned):
    body = driven(MotionTarget(turn_rate=0.5), 1.0, skid=skid)
    assert (body.heading, body.north, body.east) == (pytest.approx(turned), 0.0, 0.0)


def test_no_turn_is_faster_than_it_can():
    assert driven(MotionTarget(turn_rate=9.0), 1.0, skid=True).heading == pytest.approx(1.0)
    assert driven(MotionTarget(turn_rate=-9.0), 1.0, skid=True).heading == pytest.approx(math.tau - 1.0)


def test_a_requested_turn_rate_overrides_the_course():
    body = driven(MotionTarget(ve=3.0, turn_rate=0.2), 1.0, along=3.0)
    assert body.turn_rate == pytest.approx(0.2)


def test_a_slow_rover_turns_slowly():
    slow = driven(MotionTarget(vn=0.1, turn_rate=1.0), DT)
    fast = driven(MotionTarget(vn=3.0, turn_rate=1.0), DT, along=3.0)
    assert 0.0 < slow.turn_rate < fast.turn_rate == 1.0


def test_wind_and_gravity_do_not_move_it():
    body = WheeledBody()
    body.advance(MotionTarget(vd=-3.0), AGILITY, (5.0, 5.0), DT)
    assert (body.north, body.east, body.down) == (0.0, 0.0, 0.0)
