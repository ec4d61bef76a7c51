"""What is seen of the robots of a run, and what a step requires of them; the unknown meets nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.missions.facts import HEALTHS, MOVED, RobotFacts
from fleet.missions.program import Condition, Require
from fleet.missions.state import Facts

percents = st.none() | st.floats(0, 100)
HERE = (1.0, 2.0, 3.0)


def seen(*facts):
    known = RobotFacts()
    for each in facts:
        known.replace(each)
    return known


def test_of_a_robot_never_seen_nothing_is_known():
    known = seen()
    assert known.position("rex") is None
    assert known.words("rex") == "nothing is seen of it"
    assert known.lacks("rex", Require()) == "nothing is known of it yet"
    assert not known.holds(Condition("all", health="ok"), ["rex"], 0.0)
    assert not known.holds(Condition("all", battery_max=100), ["rex"], 0.0)


def test_the_newest_facts_replace_those_before_which_are_returned():
    known = RobotFacts()
    first, second = Facts("rex", position=HERE), Facts("rex", position=(4.0, 5.0, 6.0))
    assert known.replace(first) is None
    assert known.replace(Facts("ada")) is None
    assert known.replace(second) is first
    assert known.position("rex") == (4.0, 5.0, 6.0)


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        (Facts("rex"), "ok, idle"),
        (Facts("rex", "fault", progress="goto 40 %"), "fault, goto 40 %"),
        (Facts("rex", position=(1.25, -0.04, 12.0)), "ok, idle, at 1.2 -0.0 12.0"),
    ],
)
def test_it_says_what_is_seen_of_a_robot(facts, words):
    assert seen(facts).words("rex") == words


@pytest.mark.parametrize("health", HEALTHS)
@pytest.mark.parametrize("worst", ["ok", "degraded"])
def test_a_health_worse_than_the_worst_permitted_is_refused(health, worst):
    lacking = seen(Facts("rex", health)).lacks("rex", Require(worst))
    meets = health in ("ok", worst)
    assert lacking == ("" if meets else f"its health is {health}, {worst} is required")


def test_a_health_that_this_version_does_not_know_is_refused():
    assert seen(Facts("rex", "splendid")).lacks("rex", Require()) == (
        "its health is splendid, degraded is required"
    )


@pytest.mark.parametrize(
    ("battery", "words"),
    [
        (60.0, ""),
        (59.6, "its battery is at 59.6 %, 60 % is required"),
        (12.0, "its battery is at 12 %, 60 % is required"),
        (90.0, ""),
        (90.5, "its battery is at 90.5 %, at most 90 % is required"),
        (None, "its battery is unknown"),
    ],
)
def test_the_bounds_of_a_battery_are_within_it(battery, words):
    require = Require(battery_min=60, battery_max=90)
    assert seen(Facts("rex", battery=battery)).lacks("rex", require) == words


def test_a_battery_without_bounds_need_not_be_known():
    assert seen(Facts("rex", battery=None)).lacks("rex", Require()) == ""


@given(battery=percents, least=percents, most=percents)
def test_a_robot_meets_a_requirement_exactly_when_its_battery_is_known_and_within_its_bounds(
    battery, least, most
):
    bounded = least is not None or most is not None
    within = battery is not None and (least is None or least <= battery) and (most is None or battery <= most)
    known = seen(Facts("rex", battery=battery))
    assert (known.lacks("rex", Require("degraded", least, most)) == "") == (within or not bounded)
    if bounded:
        condition = Condition("all", battery_min=least, battery_max=most)
        assert known.holds(condition, ["rex"], 0.0) == within


def test_the_health_is_refused_before_the_battery():
    lacking = seen(Facts("rex", "fault", 5.0)).lacks("rex", Require(battery_min=60))
    assert lacking == "its health is fault, degraded is required"


@pytest.mark.parametrize(
    ("metres", "words"),
    [(0.0, ""), (MOVED, ""), (MOVED + 0.5, "it is 3.5 m from where it was left")],
)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_robot_has_moved_when_it_is_more_than_a_few_metres_away(axis, metres, words):
    left = (0.0, 0.0, 0.0)
    now = tuple(metres if each == axis else 0.0 for each in range(3))
    assert seen(Facts("rex", position=now)).moved("rex", left) == words


def test_a_robot_whose_position_was_known_and_is_not_may_be_anywhere():
    assert seen(Facts("rex")).moved("rex", HERE) == "its position is unknown"
    assert seen().moved("rex", HERE) == "its position is unknown"


def test_a_robot_whose_position_was_never_known_is_not_said_to_have_moved():
    assert seen(Facts("rex", position=HERE)).moved("rex", None) == ""
    assert seen(Facts("rex")).moved("rex", None) == ""


def test_a_condition_holds_of_any_robot_or_of_all():
    known = seen(Facts("rex", "fault"), Facts("ada", "ok"))
    of_any, of_all = Condition("all", health="ok"), Condition("all", every=True, health="ok")
    assert known.holds(of_any, ["rex", "ada"], 0.0)
    assert not known.holds(of_all, ["rex", "ada"], 0.0)
    assert known.holds(of_all, ["ada"], 0.0)
    assert not known.holds(of_any, ["rex"], 0.0)


@pytest.mark.parametrize("every", [False, True])
def test_no_condition_holds_of_nobody(every):
    assert not seen(Facts("rex")).holds(Condition("feet", every=every, health="ok"), [], 0.0)


def test_a_condition_on_health_is_that_health_and_no_better():
    known = seen(Facts("rex", "degraded"))
    assert known.holds(Condition("all", health="degraded"), ["rex"], 0.0)
    assert not known.holds(Condition("all", health="fault"), ["rex"], 0.0)


def test_an_event_counts_from_the_beginning_of_the_wait_on():
    known = seen(Facts("rex"))
    condition = Condition("eye", event="person_seen")
    known.record_event("rex", "person_seen", 10.0)
    assert known.holds(condition, ["rex"], 10.0)
    assert not known.holds(condition, ["rex"], 10.1)
    known.record_event("rex", "person_seen", 12.0)
    assert known.holds(condition, ["rex"], 10.1)


def test_an_event_of_another_robot_or_another_name_does_not_count():
    known = seen(Facts("rex"), Facts("ada"))
    known.record_event("ada", "person_seen", 10.0)
    known.record_event("rex", "arrived", 10.0)
    assert not known.holds(Condition("eye", event="person_seen"), ["rex"], 0.0)
