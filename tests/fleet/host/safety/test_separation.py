"""The rules that keep robots apart."""

import itertools

import msgspec
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from fleet.host.safety.separation import (
    ADMITTED,
    HELD,
    SOONER,
    Occupant,
    admitted,
    free_speed,
    gap,
    must_brake,
    needed,
    route_trouble,
    speed_within,
    stopping,
)
from fleet.model.geometry import Vector3
from fleet.model.polyline import apart

METRES = st.floats(-20, 20)
POINT = st.builds(Vector3, METRES, METRES, st.floats(0, 5))
VELOCITY = st.builds(Vector3, st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1))
ROBOT = st.builds(
    Occupant,
    name=st.sampled_from(["rex", "ugv"]),
    radius=st.floats(0.2, 2),
    braking=st.floats(0.5, 3),
    at=POINT,
    velocity=VELOCITY,
    requested=VELOCITY,
    turn=st.floats(-2, 2),
    moves=st.booleans(),
    precedence=st.tuples(st.floats(0, 3)),
)
OTHER = st.builds(
    Occupant,
    name=st.just("other"),
    radius=st.floats(0.2, 2),
    braking=st.floats(0.5, 3),
    at=POINT,
    route=st.lists(POINT, max_size=3).map(tuple),
    velocity=VELOCITY,
    age=st.floats(0, 20),
    moves=st.booleans(),
    precedence=st.tuples(st.floats(0, 3)),
)


def standing(name="ugv-1", x=0.0, y=0.0, **fields):
    return Occupant(name, 0.4, 1.0, Vector3(x, y), **fields)


@given(st.floats(0, 10), st.floats(0.3, 5))
def test_the_speed_within_a_way_is_that_whose_stop_takes_it(speed, braking):
    assert speed_within(stopping(speed, braking), braking) == pytest.approx(speed, abs=1e-6)


@given(ROBOT, st.lists(POINT, min_size=1, max_size=4), OTHER)
def test_no_way_that_is_admitted_comes_nearer_than_the_radii_or_than_it_begins(robot, points, other):
    trouble = route_trouble(robot, points, [other])
    nearest = apart((robot.at, *points), other.occupied_path)
    begins = apart((robot.at,), other.occupied_path)
    if not trouble:
        assert nearest >= min(needed(robot, other) + ADMITTED, begins) - 0.05
    else:
        assert nearest < needed(robot, other) + ADMITTED or robot.aside(points[0]).norm()
        assert "other" in trouble


# One that comes so fast that it may reach the robot: what drives to meet it is not admitted for that.
MET = Occupant("rex", 1.0, 1.0, Vector3(-10.0), requested=Vector3(1.0))
COMING = Occupant("other", 1.0, 1.0, Vector3(-6.0), velocity=Vector3(-2.0), moves=True)


@example(MET, COMING)
@given(ROBOT, OTHER)
def test_what_is_admitted_of_a_velocity_never_leads_nearer_than_the_radii_or_than_it_is(robot, other):
    robot = Occupant(
        robot.name, robot.radius, robot.braking, robot.at, requested=robot.requested, turn=robot.turn
    )
    share = admitted(robot, robot.requested, other)
    assert 0.0 <= share <= 1.0
    course, theirs = robot.course(robot.requested.scaled(share)), other.stopping_path()
    here = apart((robot.at,), theirs)
    assert apart(course, theirs) >= min(needed(robot, other) + HELD, here) - 0.02


@given(ROBOT, OTHER)
def test_a_robot_that_turns_may_also_brake_straight_ahead_from_what_is_admitted(robot, other):
    share = admitted(robot, robot.requested, other)
    straight = msgspec.structs.replace(robot, turn=0.0).course(robot.requested.scaled(share))
    theirs, least = other.stopping_path(), needed(robot, other) + HELD
    assert apart(straight, theirs) >= min(least, apart((robot.at,), theirs)) - 1e-5


@given(ROBOT, OTHER, VELOCITY)
def test_a_velocity_that_comes_no_nearer_passes_whole(robot, other, velocity):
    sooner = SOONER if other.moves and robot.gives_way_to(other) else 0.0
    for theirs in (other.stopping_path(sooner), other.stopping_path()):
        assume(apart(robot.course(velocity), theirs) >= apart((robot.at,), theirs))
    assert admitted(robot, velocity, other) == 1.0


@given(ROBOT, OTHER, st.sampled_from([*itertools.product((-1.0, 0.0, 1.0), repeat=3)]))
def test_below_the_free_speed_every_direction_passes(robot, other, direction):
    robot = Occupant(robot.name, robot.radius, robot.braking, robot.at)
    free, heading = free_speed(gap(robot, other, 0.2), robot.braking, 0.2), Vector3(*direction)
    assume(heading.norm() and free > 0.1)
    assert admitted(robot, heading.scaled(0.999 * min(free, 9.0) / heading.norm()), other) == 1.0


@given(ROBOT, OTHER)
def test_a_robot_that_stands_never_has_to_brake(robot, other):
    still = Occupant(robot.name, robot.radius, robot.braking, robot.at)
    assert not must_brake(still, other)


def test_of_two_in_each_others_way_the_one_with_less_precedence_brakes_first():
    east, west = Vector3(1.0), Vector3(-1.0)
    for apart_by in (5.2, 4.9, 4.6, 4.3, 4.0, 3.7):
        dog = standing("dog-1", velocity=east, moves=True, precedence=(1.0,))
        ugv = standing("ugv-1", x=apart_by, velocity=west, moves=True, precedence=(2.0,))
        brakes = must_brake(dog, ugv), must_brake(ugv, dog)
        if any(brakes):
            break
    assert brakes == (True, False)


def test_one_that_flees_from_another_that_comes_after_it_is_not_held():
    ahead = standing("ahead", x=1.0, velocity=Vector3(1.0), moves=True)
    behind = standing("behind", velocity=Vector3(2.0), moves=True)
    assert not must_brake(ahead, behind)
    assert must_brake(behind, ahead)
    assert admitted(ahead, Vector3(1.0), behind) == 1.0


def test_a_parallel_way_at_the_radii_is_not_held():
    one = standing("one", velocity=Vector3(1.0), route=(Vector3(20.0),), moves=True)
    other = standing("other", x=8.0, y=1.0, velocity=Vector3(-1.0), route=(Vector3(-20.0, 1.0),), moves=True)
    assert not must_brake(one, other)
    assert not must_brake(other, one)


def test_a_goal_short_of_another_is_reached_without_being_held():
    one = standing("one", x=3.0, velocity=Vector3(1.0), route=(Vector3(4.0),), moves=True)
    assert not must_brake(one, standing("other", x=5.0))


def test_a_place_that_was_not_reported_for_long_grows_as_far_as_the_robot_may_have_gone_and_no_farther():
    moving = [standing(velocity=Vector3(1.0), age=age).uncertainty for age in (0.0, 1.0, 2.0, 10.0, 500.0)]
    assert moving == [0.0, 0.0, 2.0, 10.0, 10.0]
    assert standing(age=500.0).uncertainty == 0.0


def test_a_refusal_names_who_where_and_how_far():
    robot = standing("rex")
    assert route_trouble(robot, [Vector3(3.0)], [standing("ugv-1", x=3.5)]) == (
        "goal 1 is 0.5 m from ugv-1, 1.0 m are kept"
    )
    assert route_trouble(robot, [Vector3(6.0)], [standing("ugv-1", x=3.0)]) == (
        "the straight way to goal 1 is 0.0 m from ugv-1, 1.0 m are kept"
    )
    crossing = standing("ugv-1", x=3.0, y=-5.0, route=(Vector3(3.0, 5.0),))
    assert "from ugv-1's way" in route_trouble(robot, [Vector3(6.0)], [crossing])


def test_one_that_stands_too_near_may_leave_and_may_not_come_back():
    robot, other = standing("rex"), standing("ugv-1", x=0.5)
    assert route_trouble(robot, [Vector3(-5.0)], [other]) == ""
    assert "goal 2" in route_trouble(robot, [Vector3(-5.0), Vector3(0.0)], [other])
    assert route_trouble(robot, [Vector3(0.2)], [other])
