"""A simulated aircraft with wings: it flies along its nose, banks, and has a lowest speed."""

import math

import pytest

from fleet_mavlink.sim.physics import GRAVITY, Agility, MotionTarget
from fleet_mavlink.sim.plane_physics import WING_SPEED, VtolBody, WingedBody

AGILITY = Agility(across=4.0, along=2.0, turn=1.0)
CALM = (0.0, 0.0)
DT = 0.02
NORTH = MotionTarget(vn=15.0)


def flown(body, aim, seconds, wind=CALM):
    for _ in range(round(seconds / DT)):
        body.advance(aim, AGILITY, wind, DT)
    return body


def cruising(**more):
    return WingedBody(down=-50.0, vn=15.0, **more)


def test_it_runs_along_the_ground_and_lifts_off_at_its_lowest_speed():
    body, climb = WingedBody(), MotionTarget(vn=15.0, vd=-3.0)
    flown(body, climb, 2.0)
    assert (body.speed, body.height) == (pytest.approx(8.0), 0.0)
    flown(body, climb, 3.0)
    assert body.height > 2.0


def test_in_the_air_it_flies_no_slower_than_it_can():
    body = flown(cruising(), MotionTarget(vn=1.0), 10.0)
    assert body.speed == pytest.approx(9.0)


def test_without_enough_speed_it_does_not_climb():
    body = flown(WingedBody(down=-50.0, vn=4.0), MotionTarget(vn=4.0, vd=-3.0), 1.0)
    assert body.vd >= 0.0


def test_it_turns_by_banking_and_no_tighter_than_its_bank_lets_it():
    body = flown(cruising(), MotionTarget(ve=15.0), 1.0)
    assert body.turn_rate == pytest.approx(GRAVITY / 15.0)
    assert body.roll == pytest.approx(math.radians(45.0))
    assert (body.vn, body.ve) == pytest.approx((15.0 * math.cos(body.heading), 15.0 * math.sin(body.heading)))
    body = flown(cruising(), MotionTarget(ve=-15.0), 1.0)
    assert (body.turn_rate, body.roll) == (pytest.approx(-GRAVITY / 15.0), pytest.approx(-math.radians(45.0)))


def test_a_turn_ends_on_its_course():
    body = flown(cruising(), MotionTarget(ve=15.0), 15.0)
    assert body.heading == pytest.approx(math.pi / 2, abs=0.01)
    assert body.turn_rate == pytest.approx(0.0, abs=0.01)


def test_without_a_course_it_keeps_its_heading():
    assert flown(cruising(heading=1.0), MotionTarget(), 2.0).heading == pytest.approx(1.0)


def test_a_climb_is_limited_and_raises_the_nose():
    body = flown(cruising(), MotionTarget(vn=15.0, vd=-4.0), 1.0)
    assert body.vd == pytest.approx(-2.0)
    assert body.pitch == pytest.approx(math.atan2(2.0, 15.0), abs=0.01)


def test_wind_moves_it_beside_its_speed_through_the_air():
    body = flown(cruising(), NORTH, 2.0, wind=(0.0, 3.0))
    assert (body.north, body.east, body.speed) == pytest.approx((30.0, 6.0, 15.0))


def test_it_stops_sinking_on_the_ground():
    body = flown(WingedBody(down=-1.0, vn=15.0), MotionTarget(vn=15.0, vd=2.0), 5.0)
    assert (body.down, body.vd, body.pitch) == (0.0, 0.0, 0.0)


def test_a_vtol_hovers_on_its_rotors_and_flies_on_its_wings():
    hovering = flown(VtolBody(down=-50.0), MotionTarget(), 2.0)
    assert (hovering.speed, hovering.height) == (0.0, 50.0)
    flying = flown(VtolBody(down=-50.0, hovers=False, vn=15.0), MotionTarget(), 5.0)
    assert flying.speed == pytest.approx(9.0)


def test_a_vtol_slows_down_from_its_wings_by_its_rotors_as_they_can():
    body = VtolBody(down=-50.0, vn=15.0, slows=1.0)
    assert flown(body, MotionTarget(), 1.0).speed == pytest.approx(14.0)
    flown(body, MotionTarget(), 5.0)
    assert body.speed < WING_SPEED
    before = body.speed
    assert flown(body, MotionTarget(), 1.0).speed == pytest.approx(before - 4.0), (
        "slower, it is like a multirotor"
    )
