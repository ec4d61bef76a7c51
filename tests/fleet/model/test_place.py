"""Named places: their point, and who fits."""

import pytest

from fleet.model.geometry import Vector3
from fleet.model.place import Place, is_allowed_point, point_of
from fleet.model.polygon import centroid, polygon_contains

SQUARE = ((10.0, 0.0), (14.0, 0.0), (14.0, 4.0), (10.0, 4.0))
BEND = ((0.0, 0.0), (9.0, 0.0), (9.0, 1.0), (1.0, 1.0), (1.0, 9.0), (0.0, 9.0))


def test_robots_are_sent_to_the_middle_of_an_area_half_way_up():
    assert point_of(SQUARE, None) == pytest.approx((12.0, 2.0))
    assert point_of(SQUARE, (1.0, 4.0)) == pytest.approx((12.0, 2.0, 2.5))


def test_the_middle_of_a_bend_is_outside_of_it():
    assert not polygon_contains(BEND, centroid(BEND))
    assert point_of(BEND, None) == ()


def test_the_middle_is_right_far_from_the_origin_and_either_way_round():
    far = tuple((x + 5e6, y - 5e6) for x, y in SQUARE)
    for polygon in (far, far[::-1]):
        assert centroid(polygon) == pytest.approx((5e6 + 12.0, -5e6 + 2.0), abs=1e-6)


def test_no_more_robots_fit_than_its_capacity():
    dock = Place("dock-1", (1.0, 2.0))
    assert dock.trouble([Vector3()]) == ""
    assert dock.trouble([Vector3(), Vector3()]) == "dock-1 has room for 1, these are 2"


def test_robots_fit_within_its_radius_or_its_polygon():
    pad = Place("pad", (5.0, 5.0), radius=2.0, capacity=4)
    assert pad.trouble([Vector3(2.0), Vector3(-1.0)]) == ""
    assert "do not fit into pad" in pad.trouble([Vector3(2.1)])
    yard = Place("yard", (12.0, 2.0), polygon=SQUARE, capacity=4)
    assert yard.trouble([Vector3(1.9, 1.9), Vector3(-1.9, 0.0)]) == ""
    assert "do not fit into yard" in yard.trouble([Vector3(2.1)])


def test_a_polygon_on_earth_is_metres_too():
    corners = ((47.0, 8.0), (47.0002, 8.0), (47.0002, 8.0002), (47.0, 8.0002))  # 22 m by 15 m
    yard = Place("yard", (47.0001, 8.0001), frame="geodetic", polygon=corners, capacity=4)
    assert yard.trouble([Vector3(7.0, 10.5)]) == ""
    assert "do not fit" in yard.trouble([Vector3(8.0)])
    assert "do not fit" in yard.trouble([Vector3(0.0, 11.5)])


def test_a_fence_lets_a_robot_be_in_any_inclusion_and_in_no_exclusion():
    assert is_allowed_point((0.0, 0.0), (), ())
    assert is_allowed_point((11.0, 1.0), (BEND, SQUARE), ())
    assert not is_allowed_point((5.0, 5.0), (BEND, SQUARE), ())
    assert not is_allowed_point((11.0, 1.0), (SQUARE,), (SQUARE,))
