"""The fence: places, ways and velocities."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.host.safety.fence import LOOK_AHEAD, Fence
from fleet.model.geometry import Vector3

HOME = Vector3()
YARD = ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))
POND = ((10.0, -5.0), (20.0, -5.0), (20.0, 5.0), (10.0, 5.0))
FENCE = Fence((YARD,), (POND,), ceiling=30.0, distance=45.0, margin=1.0)
speeds = st.floats(-5, 5)
places = st.floats(-60, 60)


@pytest.mark.parametrize(
    ("place", "why"),
    [
        (Vector3(0, 0, 5), ""),
        (Vector3(15, 0, 5), "in an exclusion of the fence"),
        (Vector3(51, 0, 5), "outside the fence"),
        (Vector3(40, 40, 5), "57 m from home, the limit is 45 m"),
        (Vector3(0, 0, 31), "31.0 m above home, the limit is 30 m"),
    ],
)
def test_a_place_is_judged_with_the_reason(place, why):
    assert FENCE.trouble(place, HOME) == why


def test_heights_and_distances_count_from_home():
    assert FENCE.trouble(Vector3(0, 0, 45), Vector3(0, 0, 20)) == ""
    assert "from home" in FENCE.trouble(Vector3(40, 0, 0), Vector3(-10, 0, 0))


def test_a_way_through_an_exclusion_is_refused_though_its_end_is_allowed():
    assert "leads out" in FENCE.way_trouble(Vector3(0, 0, 5), [Vector3(30, 0, 5)], HOME)
    round_it = [Vector3(15, 20, 5), Vector3(30, 0, 5)]
    assert FENCE.way_trouble(Vector3(0, 0, 5), round_it, HOME) == ""
    assert FENCE.way_trouble(Vector3(), [*round_it, Vector3(70, 0, 5)], HOME) == "goal 3 is outside the fence"


def test_who_is_outside_may_come_in():
    assert FENCE.way_trouble(Vector3(60, 0, 5), [Vector3(30, 0, 5)], HOME) == ""


def test_a_velocity_that_leads_out_is_held_no_more():
    assert FENCE.admitted(Vector3(0, 0, 5), Vector3(5, 0, 0), HOME) == Vector3(5, 0, 0)
    assert FENCE.admitted(Vector3(5, 0, 5), Vector3(5, 0, 0), HOME) == Vector3()
    assert FENCE.admitted(Vector3(0, 0, 28), Vector3(1, 0, 2), HOME) == Vector3(1, 0, 0)
    assert FENCE.admitted(Vector3(55, 0, 5), Vector3(-2, 0, 0), HOME) == Vector3(-2, 0, 0)


def test_a_thin_exclusion_is_not_jumped_over_by_looking_far_ahead():
    wall = ((5.0, -5.0), (5.5, -5.0), (5.5, 5.0), (5.0, 5.0))
    assert Fence(exclusion=(wall,)).admitted(Vector3(), Vector3(5, 0, 0), HOME) == Vector3()


def test_who_is_in_an_exclusion_may_not_leave_through_the_depth_of_it():
    at = Vector3(11, 2, 5)
    assert FENCE.admitted(at, Vector3(1, 1, 0), HOME) == Vector3()
    assert FENCE.admitted(at, Vector3(-1, 1, 0), HOME) == Vector3(-1, 1, 0)


@settings(max_examples=500)
@given(x=places, y=places, vx=speeds, vy=speeds)
def test_what_is_admitted_never_leads_farther_out(x, y, vx, vy):
    point = Vector3(x, y, 5.0)
    admitted = FENCE.admitted(point, Vector3(vx, vy, 0), HOME)
    ahead = point + admitted.scaled(LOOK_AHEAD)
    assert FENCE._beyond(ahead, HOME) <= FENCE._beyond(point, HOME) + 1e-9


def test_the_noise_of_a_position_is_no_breach():
    assert FENCE.breach(Vector3(0, 0, 30.5), HOME) == ""
    assert FENCE.breach(Vector3(0, 0, 31.5), HOME) != ""
    assert FENCE.breach(Vector3(50.4, 0, 5), Vector3(20, 0, 0)) == ""
    assert FENCE.breach(Vector3(52.0, 0, 5), Vector3(20, 0, 0)) == "outside the fence"


def test_a_goal_that_is_circled_must_keep_its_circle_from_every_border():
    field = Fence(
        (((-400.0, -400.0), (400.0, -400.0), (400.0, 400.0), (-400.0, 400.0)),), (POND,), distance=350.0
    )
    here = Vector3(0, 200, 40)
    assert field.way_trouble(here, [Vector3(0, 240, 40)], HOME, [95.0]) == ""
    near = "goal 1 is 60 m from the fence, and it circles 95 m about it"
    assert field.way_trouble(here, [Vector3(-290, 0, 40)], HOME, [95.0]) == near
    assert "from the fence" in field.way_trouble(here, [Vector3(60, 0, 40)], HOME, [95.0]), "the pond"
    passed = [Vector3(-290, 0, 40), Vector3(0, 240, 40)]
    assert field.way_trouble(here, passed, HOME, [0.0, 95.0]) == ""
