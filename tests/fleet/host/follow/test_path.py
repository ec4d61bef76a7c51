import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.follow.path import Path

CORNER = Path([(0, 0), (1, 0), (1, 1)])


def test_a_path_knows_its_length_its_points_and_its_end():
    assert CORNER.length == 2.0
    assert CORNER.point(0.5) == (0.5, 0.0)
    assert CORNER.point(1.5) == (1.0, 0.5)
    assert CORNER.point(9.0) == CORNER.end == (1, 1)


def test_nothing_round_a_corner_is_aimed_at_before_the_corner_was_reached():
    assert CORNER.aim(0.8, 0.5) == (1.0, 0.0)
    assert CORNER.aim(0.96, 0.5) == pytest.approx((1.0, 0.46))
    assert CORNER.to_corner(0.25) == 0.75


def test_a_gentle_bend_is_cut():
    bend = Path([(0, 0), (1, 0), (2, 0.2)])
    assert bend.aim(0.9, 0.5)[1] > 0


def test_points_that_were_passed_are_counted():
    assert [CORNER.passed(travelled) for travelled in (0.0, 0.9, 0.95, 2.0)] == [0, 0, 1, 1]


def test_a_path_that_crosses_itself_is_followed_in_order():
    eight = Path([(0, 0), (2, 2), (2, 0), (0, 2)])
    assert eight.ahead((1.0, 1.0), 1.0) == pytest.approx(math.sqrt(2))
    assert eight.ahead((1.0, 1.0), 5.5) > 5.5


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=6), st.data())
def test_the_place_on_the_way_never_falls_and_never_leaves_the_path(points, data):
    path, travelled = Path(points), 0.0
    for _ in range(5):
        here = data.draw(st.tuples(st.floats(-6, 6), st.floats(-6, 6)))
        before, travelled = travelled, path.ahead(here, travelled)
        assert before <= travelled <= path.length + 1e-9
