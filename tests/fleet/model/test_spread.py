"""Places for several robots around one point."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.geometry import Vector3
from fleet.model.polyline import apart
from fleet.model.spread import arranged, grid_positions, nearest_each


@given(st.integers(1, 30), st.floats(0.5, 50))
def test_all_are_as_far_from_each_other_as_was_asked_and_around_the_point(number, spacing):
    places = grid_positions(number, spacing)
    assert len(places) == number
    assert all((a - b).norm() >= spacing * 0.999 for a, b in itertools.combinations(places, 2))
    assert max(place.norm() for place in places) <= spacing * math.sqrt(number)


METRES = st.floats(-30, 30)


@given(st.lists(st.tuples(METRES, METRES), min_size=2, max_size=7, unique=True))
def test_every_place_has_one_robot_and_no_two_straight_ways_cross(at):
    robots = [Vector3(x, y) for x, y in at]
    places = grid_positions(len(robots), 5.0)
    order = nearest_each(robots, places)
    assert sorted(order) == list(range(len(robots)))
    paths = [(robot, places[number]) for robot, number in zip(robots, order, strict=True)]
    for (a, b), (c, d) in itertools.combinations(paths, 2):
        properly = _side(a, b, c) * _side(a, b, d) < -1e-3 and _side(c, d, a) * _side(c, d, b) < -1e-3
        assert not properly, apart((a, b), (c, d))


def _side(a, b, c):
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)


def test_the_grid_is_turned_so_that_those_who_come_from_one_side_do_not_pass_each_others_places():
    robots, centre = [Vector3(0, 11), Vector3(0, 22)], Vector3(15, 16)
    places = [centre + step for step in arranged(robots, centre, 6.0)]
    paths = list(zip(robots, places, strict=True))
    assert apart(*paths) > 5.0
    assert (places[0] - places[1]).norm() == pytest.approx(6.0)


def test_two_robots_take_the_places_on_their_own_sides():
    assert nearest_each([Vector3(5, 0), Vector3(-5, 0)], grid_positions(2, 4.0)) == [1, 0]


def test_one_robot_goes_to_the_point_itself():
    (place,) = grid_positions(1, 3.0)
    assert place.norm() == pytest.approx(0.0)
