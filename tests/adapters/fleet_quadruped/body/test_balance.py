import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fleet_quadruped.body.balance import GRAVITY, Balance, inside, loads

FEET = [(0.19, 0.12, 0.0), (0.19, -0.12, 0.0), (-0.19, 0.12, 0.0), (-0.19, -0.12, 0.0)]
ALL, THREE, TWO = [True] * 4, [True, True, False, True], [True, False, False, True]
STILL = MIDDLE = (0.0, 0.0)
HEIGHT = 0.27


def pressed(feet, shares):
    """Return the place on which feet press together."""
    pairs = list(zip(feet, shares, strict=True))
    return tuple(sum(foot[axis] * share for foot, share in pairs) for axis in (0, 1))


@given(st.floats(-0.08, 0.08), st.floats(-0.05, 0.05))
def test_four_feet_press_where_they_are_to(x, y):
    shares = loads(FEET, ALL, (x, y))
    assert sum(shares) == pytest.approx(1.0)
    assert pressed(FEET, shares) == pytest.approx((x, y), abs=1e-3)


def test_three_feet_bear_what_the_place_among_them_says():
    shares = loads(FEET, THREE, (0.05, -0.05))
    assert shares[2] == 0.0
    assert pressed(FEET, shares) == pytest.approx((0.05, -0.05), abs=2e-3)


def test_two_feet_share_the_weight_along_their_line():
    assert loads(FEET, TWO, (0.0, 0.0)) == pytest.approx([0.5, 0.0, 0.0, 0.5])
    assert loads(FEET, TWO, (0.095, 0.06)) == pytest.approx([0.75, 0.0, 0.0, 0.25], abs=1e-3)


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_no_foot_pulls_on_the_ground(x, y):
    shares = loads(FEET, THREE, (x, y))
    assert min(shares) >= 0.0
    assert sum(shares) == pytest.approx(1.0)


def beside(point, start, end):
    """Return how far (m) a point is to the left of a line."""
    long = math.dist(start, end)
    across = (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
    return across / long if long > 0.02 else 0.0


@given(*[st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.just(0.0))] * 3)
def test_a_place_is_moved_to_the_side_of_the_third_foot(start, end, place):
    high = beside(FEET[0], start, end)
    assume(abs(high) > 0.02)
    away = beside(inside(place[:2], start, end, FEET[0]), start, end)
    assert away * math.copysign(1, high) >= min(0.045, 0.35 * abs(high)) - 1e-9


def test_a_place_that_is_well_inside_stays():
    assert inside((0.0, -0.06), FEET[0], FEET[3], FEET[1]) == (0.0, -0.06)


def test_it_falls_away_from_where_it_presses_as_a_pendulum_does():
    balance, dt, seen = Balance(), 0.001, []
    for cycle in range(700):
        balance.step(dt, HEIGHT, (0.0, 0.06), (0.0, -0.06), left=0.7 - cycle * dt, pull=STILL)
        seen.append(balance.y)
    for before, now, after in list(zip(seen, seen[1:], seen[2:], strict=False))[300::50]:
        accelerates = (after - 2 * now + before) / dt**2
        assert accelerates == pytest.approx(GRAVITY / HEIGHT * (now - 0.06), abs=0.02)


def test_it_arrives_on_its_way_to_rest_at_the_goal():
    balance, dt = Balance(), 0.001
    for cycle in range(700):
        balance.step(dt, HEIGHT, (0.0, 0.06), (0.0, -0.06), left=0.7 - cycle * dt, pull=STILL)
    for _ in range(2000):
        balance.step(dt, HEIGHT, (0.0, -0.06), (0.0, -0.06), left=0.7, pull=STILL)
    assert balance.y == pytest.approx(-0.06, abs=1e-4)
    assert balance.speed == pytest.approx((0, 0), abs=1e-4)


def test_it_leans_into_an_acceleration_but_not_far():
    balance = Balance()
    for pull, lean in (((1.0, -0.5), (HEIGHT / GRAVITY, -0.5 * HEIGHT / GRAVITY)), ((9.0, 0.0), (0.05, 0.0))):
        for _ in range(200):
            balance.step(0.01, HEIGHT, MIDDLE, MIDDLE, left=0.0, pull=pull)
        assert (balance.x, balance.y) == pytest.approx(lean, abs=1e-4)
