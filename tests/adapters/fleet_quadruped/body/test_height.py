"""The standing height: from the hip axes down to the lowest foot, however the body is turned."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Quaternion, quaternion_from_euler
from fleet_quadruped.body.height import height_of
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
RADIUS = DOG.geometry.foot_radius


def turned(roll=0.0, pitch=0.0):
    """Return a rotation about x or y."""
    half = (roll or pitch) / 2
    return Quaternion(math.cos(half), *((math.sin(half), 0.0) if roll else (0.0, math.sin(half))), 0.0)


def height(posture, turn=turned()):  # noqa: B008
    return height_of(DOG.legs, RADIUS, posture, turn)


@given(st.floats(DOG.gait.lowest, DOG.gait.highest))
def test_an_upright_dog_is_as_high_as_it_stands(metres):
    assert height(DOG.stance(metres)) == pytest.approx(metres, abs=0.001)


@pytest.mark.parametrize("roll", [-0.5, 0.5])
def test_a_tilted_dog_is_as_high_as_its_lowest_foot_says(roll):
    aside = DOG.geometry.hip_y + DOG.geometry.abad_offset
    lowest = (0.27 - RADIUS) * math.cos(roll) + aside * math.sin(abs(roll)) + RADIUS
    assert height(DOG.stance(0.27), turned(roll)) == pytest.approx(lowest, abs=0.001)


@pytest.mark.parametrize("pitch", [-0.4, 0.4])
def test_a_dog_on_a_slope_is_as_high_as_the_feet_that_are_lower(pitch):
    lowest = (0.27 - RADIUS) * math.cos(pitch) + DOG.geometry.hip_x * math.sin(abs(pitch)) + RADIUS
    assert height(DOG.stance(0.27), turned(pitch=pitch)) == pytest.approx(lowest, abs=0.02)


def test_one_leg_that_is_stretched_carries_the_dog():
    low, high = DOG.stance(0.2), DOG.stance(0.3)
    for leg in range(4):
        posture = (*low[: 3 * leg], *high[3 * leg : 3 * leg + 3], *low[3 * leg + 3 :])
        assert height(posture) == pytest.approx(0.3, abs=0.001)


@given(st.floats(-math.pi, math.pi), st.sampled_from([0.0, 0.3, -0.5]), st.sampled_from([0.0, -0.4]))
def test_the_direction_of_its_nose_does_not_matter(yaw, roll, pitch):
    assert height(DOG.stance(0.27), quaternion_from_euler(roll, pitch, yaw)) == pytest.approx(
        height(DOG.stance(0.27), quaternion_from_euler(roll, pitch, 0.0))
    )


def test_a_dog_on_its_back_has_no_height():
    assert height(DOG.stance(0.27), turned(math.pi)) == 0.0
