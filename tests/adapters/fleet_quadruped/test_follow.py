import math

from hypothesis import given
from hypothesis import strategies as st

from fleet.model.geometry import rotate_to_world
from fleet_quadruped.follow import REACHED, TURNED, Place, towards

near = st.floats(-4, 4)
headings = st.floats(-3.1, 3.1)
LIMITS = {"speed": 0.5, "strafe": 0.3, "turn": 1.0, "reached": REACHED}


@given(near, near, headings, st.none() | headings)
def test_it_gets_there_from_anywhere(x, y, start, heading):
    goal, place = Place(x, y, heading), Place(0.0, 0.0, start)
    for _ in range(1200):
        velocity = towards(place, goal, **LIMITS)
        if velocity is None:
            break
        step = rotate_to_world(velocity.linear, place.yaw)
        place = Place(place.x + step.x * 0.05, place.y + step.y * 0.05, place.yaw + velocity.yaw_rate * 0.05)
    assert math.dist(place[:2], goal[:2]) <= REACHED
    assert heading is None or abs(math.remainder(place.yaw - heading, math.tau)) <= TURNED


@given(near, near, headings, headings)
def test_it_keeps_to_the_limits(x, y, start, heading):
    velocity = towards(Place(0, 0, start), Place(x, y, heading), **LIMITS)
    if velocity is not None:
        assert abs(velocity.linear.x) <= 0.5
        assert abs(velocity.linear.y) <= 0.3
        assert abs(velocity.yaw_rate) <= 1.0


def test_a_place_close_by_is_reached_sideways():
    velocity = towards(Place(0, 0, 0), Place(0, 0.4, 0), **LIMITS)
    assert velocity.linear.y > 0
    assert velocity.yaw_rate == 0
