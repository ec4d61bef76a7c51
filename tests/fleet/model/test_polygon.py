"""Polygons on the plane."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.polygon import crosses, distance_to_border, is_simple, polygon_contains

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
NOTCHED = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (5.0, 2.0), (0.0, 10.0))
coordinates = st.floats(-50, 50)
points = st.tuples(coordinates, coordinates)


def test_a_notch_is_outside():
    assert polygon_contains(NOTCHED, (1.0, 1.0))
    assert not polygon_contains(NOTCHED, (5.0, 8.0))
    assert not polygon_contains(SQUARE, (11.0, 5.0))


def test_a_way_over_a_notch_crosses_the_border_though_both_its_ends_are_inside():
    assert crosses(NOTCHED, (1.0, 6.0), (9.0, 6.0))
    assert not crosses(NOTCHED, (1.0, 1.0), (9.0, 1.0))


@pytest.mark.parametrize("point", [(5.0, 5.0), (15.0, 5.0), (13.0, 14.0)])
def test_the_distance_is_that_to_the_nearest_side(point):
    assert distance_to_border(SQUARE, point) == pytest.approx(5.0)


@pytest.mark.parametrize(
    "corners",
    [
        ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)),
        ((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)),
        ((0.0, 0.0), (0.0, 0.0), (1.0, 1.0)),
    ],
)
def test_a_line_a_bow_and_a_doubled_corner_are_no_shapes(corners):
    assert not is_simple(corners)
    assert is_simple(SQUARE)


@given(point=points, x=coordinates, y=coordinates, turn=st.floats(0, math.tau))
def test_moved_and_turned_together_nothing_changes(point, x, y, turn):
    def moved(each):
        cos, sin = math.cos(turn), math.sin(turn)
        return each[0] * cos - each[1] * sin + x, each[0] * sin + each[1] * cos + y

    distance = distance_to_border(NOTCHED, point)
    other = tuple(moved(corner) for corner in NOTCHED)
    assert distance_to_border(other, moved(point)) == pytest.approx(distance, abs=1e-6)
    if distance > 1e-6:
        assert polygon_contains(other, moved(point)) == polygon_contains(NOTCHED, point)


@given(start=points, end=points)
def test_who_goes_in_or_out_crosses_a_side(start, end):
    clear = min(distance_to_border(SQUARE, each) for each in (start, end)) > 1e-6
    if clear and polygon_contains(SQUARE, start) != polygon_contains(SQUARE, end):
        assert crosses(SQUARE, start, end)
