"""The fence: places, ways and velocities."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.host.safety.fence import LOOK_AHEAD, SLACK, Fence
from fleet.model.geometry import Vector3
from fleet.model.polygon import polygon_contains

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
    assert "leads out" in FENCE.route_trouble(Vector3(0, 0, 5), [Vector3(30, 0, 5)], HOME)
    round_it = [Vector3(15, 20, 5), Vector3(30, 0, 5)]
    assert FENCE.route_trouble(Vector3(0, 0, 5), round_it, HOME) == ""
    assert (
        FENCE.route_trouble(Vector3(), [*round_it, Vector3(70, 0, 5)], HOME) == "goal 3 is outside the fence"
    )


def test_who_is_outside_may_come_in_and_nothing_else():
    assert FENCE.route_trouble(Vector3(60, 0, 5), [Vector3(30, 0, 5)], HOME) == ""
    assert FENCE.route_trouble(Vector3(60, 0, 5), [Vector3(55, 0, 5)], HOME) == "goal 1 is outside the fence"
    through_the_pond = FENCE.route_trouble(Vector3(60, 0, 5), [Vector3(0, 0, 5)], HOME)
    assert through_the_pond == (
        "it is outside the fence, and the straight way to goal 1 does not lead back by itself"
    )
    assert FENCE.route_trouble(Vector3(12, 0, 5), [Vector3(30, 0, 5)], HOME) != "", "through its depth"
    assert FENCE.route_trouble(Vector3(12, 0, 5), [Vector3(-5, 0, 5)], HOME) == ""


def test_who_is_outside_of_a_bay_does_not_cross_the_open_side_of_it():
    bay = (
        (-50.0, -50.0),
        (50.0, -50.0),
        (50.0, 50.0),
        (20.0, 50.0),
        (20.0, -30.0),
        (-20.0, -30.0),
        (-20.0, 50.0),
        (-50.0, 50.0),
    )
    fence = Fence((bay,))
    assert fence.route_trouble(Vector3(15, 40, 5), [Vector3(30, 40, 5)], HOME) == ""
    assert "does not lead back" in fence.route_trouble(Vector3(15, 40, 5), [Vector3(-30, 40, 5)], HOME)


def test_who_is_too_high_comes_down_and_who_is_outside_does_not_climb():
    assert FENCE.route_trouble(Vector3(0, 0, 40), [Vector3(0, 0, 20)], HOME) == ""
    assert "the limit is 30 m" in FENCE.route_trouble(Vector3(0, 0, 40), [Vector3(0, 0, 35)], HOME)
    assert FENCE.admitted(Vector3(55, 0, 5), Vector3(-2, 0, 1), HOME) == Vector3(-2, 0, 0)
    assert FENCE.admitted(Vector3(55, 0, 5), Vector3(-2, 0, -1), HOME) == Vector3(-2, 0, -1)
    assert FENCE.admitted(Vector3(0, 0, 40), Vector3(1, 0, 1), HOME) == Vector3(1, 0, 0)


def test_who_is_outside_does_not_come_in_through_other_forbidden_ground():
    pond = ((45.0, -5.0), (49.0, -5.0), (49.0, 5.0), (45.0, 5.0))
    fence = Fence((YARD,), (pond,))
    assert fence.admitted(Vector3(51, 0, 5), Vector3(-2, 0, 0), HOME) == Vector3()
    assert fence.admitted(Vector3(51, 8, 5), Vector3(-2, 0, 0), HOME) == Vector3(-2, 0, 0)


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


@settings(max_examples=150)
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
    assert field.route_trouble(here, [Vector3(0, 240, 40)], HOME, [95.0]) == ""
    near = "goal 1 is 60 m from the fence, and it circles 95 m about it"
    assert field.route_trouble(here, [Vector3(-290, 0, 40)], HOME, [95.0]) == near
    assert "from the fence" in field.route_trouble(here, [Vector3(60, 0, 40)], HOME, [95.0]), "the pond"
    passed = [Vector3(-290, 0, 40), Vector3(0, 240, 40)]
    assert field.route_trouble(here, passed, HOME, [0.0, 95.0]) == ""


def forbidden(fence, point):
    """Return which parts of a fence forbid a point."""
    flat = (point.x, point.y)
    inside = any(polygon_contains(each, flat) for each in fence.inclusion)
    ponds = [number for number, each in enumerate(fence.exclusion) if polygon_contains(each, flat)]
    return {*ponds, *(() if inside else ("yard",)), *(("far",) if math.hypot(*flat) > fence.distance else ())}


@settings(max_examples=150)
@given(start=st.tuples(places, places, st.floats(0, 50)), velocity=st.tuples(speeds, speeds, speeds))
def test_a_velocity_held_from_anywhere_never_leads_farther_out(start, velocity):
    """Tried with a robot that obeys at once and is judged ten times a second."""
    point = Vector3(*start)
    for _ in range(40):
        step = FENCE.admitted(point, Vector3(*velocity), HOME).scaled(0.1)
        ahead = point + step
        assert FENCE._beyond(ahead, HOME) <= FENCE._beyond(point, HOME) + 1e-9
        assert forbidden(FENCE, ahead) <= forbidden(FENCE, point)
        assert step.z <= 0 or (ahead.z <= 30.0 and FENCE._beyond(point, HOME) <= SLACK)
        point = ahead


@settings(max_examples=150)
@given(
    start=st.tuples(places, places, st.floats(0, 50)), goals=st.lists(st.tuples(places, places), max_size=3)
)
def test_a_way_that_is_allowed_from_anywhere_only_ever_leads_back_and_stays(start, goals):
    point, ends = Vector3(*start), [Vector3(x, y, 10.0) for x, y in goals]
    if FENCE.route_trouble(point, ends, HOME):
        return
    for end in ends:
        for number in range(1, 201):
            before = point + (end - point).scaled((number - 1) / 200)
            ahead = point + (end - point).scaled(number / 200)
            assert FENCE._beyond(ahead, HOME) <= FENCE._beyond(before, HOME) + 1e-6
            assert forbidden(FENCE, ahead) <= forbidden(FENCE, before)
        point = end


@given(x=st.floats(-500, 500), y=st.floats(-500, 500), z=st.floats(0, 100))
def test_from_everywhere_there_is_a_way_and_a_velocity_back(x, y, z):
    fence = Fence((YARD,), ceiling=30.0, distance=45.0)
    point = Vector3(x, y, z)
    assert fence.route_trouble(point, [Vector3(0, 0, 10)], HOME) == ""
    back = Vector3(-x, -y, 0.0)
    if fence._beyond(point, HOME) > 0:
        velocity = back.scaled(1.0 / back.norm())
        assert fence.admitted(point, velocity, HOME) == velocity
    assert fence.admitted(point, Vector3(0, 0, -1), HOME) == Vector3(0, 0, -1)
    assert fence.admitted(point, Vector3(), HOME) == Vector3()
