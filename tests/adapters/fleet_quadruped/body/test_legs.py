import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.legs import DogLeg

LEGS = [DogLeg(0.19, 0.05 * side, side, knee, 0.07, 0.2, 0.21) for side in (1, -1) for knee in (-1, 1)]
legs = st.sampled_from(LEGS)
abads = st.floats(-0.9, 0.9)
hips = st.floats(-0.9, 1.2)
bends = st.floats(0.3, 2.6)


@given(legs, abads, hips, bends)
def test_the_foot_comes_back_to_where_the_angles_put_it(leg, abad, hip, bend):
    foot = leg.foot((abad, hip, leg.knee * bend))
    assert math.dist(leg.foot(leg.angles(foot)), foot) < 1e-6


@given(legs, abads, st.floats(-0.5, 0.5), bends)
def test_the_angles_below_the_body_come_back(leg, abad, lean, bend):
    hip = lean - leg.knee * bend / 2
    angles = (abad, hip, leg.knee * bend)
    assert leg.angles(leg.foot(angles)) == pytest.approx(angles, abs=1e-5)


@given(legs, st.tuples(*[st.floats(-2, 2)] * 3))
def test_a_foot_out_of_reach_still_gives_finite_angles(leg, foot):
    assert all(math.isfinite(angle) for angle in leg.angles(foot))


@given(legs, abads, hips, bends, st.sampled_from(range(3)))
def test_the_jacobian_is_the_slope_of_the_foot(leg, abad, hip, bend, joint):
    angles = (abad, hip, leg.knee * bend)
    moved = tuple(angle + 1e-6 * (number == joint) for number, angle in enumerate(angles))
    slope = [(b - a) / 1e-6 for a, b in zip(leg.foot(angles), leg.foot(moved), strict=True)]
    assert slope == pytest.approx(leg.reach(angles)[1][joint], abs=1e-4)


def test_a_straight_leg_hangs_down():
    x, y, z = LEGS[0].foot((0.0, 0.0, 0.0))
    assert (x, y, z) == pytest.approx((0.0, 0.07, -0.41))


def test_knees_bend_the_way_they_are_built():
    for leg in LEGS:
        knee = leg.angles((0.0, leg.side * 0.07, -0.3))[2]
        assert math.copysign(1, knee) == leg.knee
