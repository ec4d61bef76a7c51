"""How near broken lines come to each other."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.geometry import Vector3
from fleet.model.polyline import apart, beginning, length

COORDINATE = st.floats(-50, 50)
POINT = st.builds(Vector3, COORDINATE, COORDINATE, COORDINATE)
LINE = st.lists(POINT, min_size=1, max_size=9)


def points_of(line, pieces=40):
    """Return many points of a line."""
    yield line[0]
    for one, other in itertools.pairwise(line):
        for piece in range(1, pieces + 1):
            yield one + (other - one).scaled(piece / pieces)


@given(LINE, LINE)
def test_it_is_never_more_than_between_any_two_points_and_the_same_both_ways(one, other):
    least = apart(one, other)
    seen = min((here - there).norm() for here in points_of(one, 8) for there in points_of(other, 8))
    assert least <= seen + 1e-9
    assert least == pytest.approx(apart(other, one), abs=1e-6)


@given(LINE, POINT)
def test_it_is_what_many_points_of_the_line_come_near_to(line, point):
    longest = max((b - a).norm() for a, b in itertools.pairwise([*line, line[-1]]))
    seen = min((here - point).norm() for here in points_of(line))
    assert seen - longest / 40 - 1e-9 <= apart(line, [point]) <= seen + 1e-9


@given(LINE, LINE)
def test_a_bound_changes_nothing_below_it(one, other):
    least = apart(one, other)
    assert apart(one, other, least + 1.0) == pytest.approx(least)
    assert apart(one, other, least / 2) == least / 2


def test_lines_that_cross_touch_and_parallel_ones_keep_their_distance():
    cross = apart([Vector3(-1, 0), Vector3(1, 0)], [Vector3(0, -1), Vector3(0, 1)])
    beside = apart([Vector3(0, 0), Vector3(9, 0)], [Vector3(3, 2), Vector3(20, 2)])
    above = apart([Vector3(-1, 0), Vector3(1, 0)], [Vector3(0, -1, 3), Vector3(0, 1, 3)])
    assert (cross, beside, above) == (0.0, 2.0, 3.0)


@given(LINE, st.floats(0, 300))
def test_a_beginning_is_as_long_as_was_asked_and_part_of_the_line(line, metres):
    begun = beginning(line, metres)
    assert length(begun) == pytest.approx(min(metres, length(line)), abs=1e-6)
    assert all(apart([point], line) < 1e-6 for point in begun)


def test_two_paths_of_500_goals_are_compared_in_a_moment():
    one = [Vector3(math.sin(i) * 40, i * 0.1, 0) for i in range(500)]
    other = [Vector3(math.cos(i) * 40, i * 0.1, 6.0) for i in range(500)]
    calls = []

    class Counted(list):
        def __getitem__(self, key):
            calls.append(key)
            return super().__getitem__(key)

    assert apart(Counted(one), other, 5.0) == 5.0  # their boxes are apart: neither is looked into
    assert len(calls) < 10
