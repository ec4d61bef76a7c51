"""What a run cannot ask of robots of other edges is said before anything moves."""

import queue

import pytest

from tests.fleet.missions.yard import MISSION

WAIT = {"id": "look", "wait_for": {"role": "feet", "event": "battery_low", "timeout": "1 min"}}
GO = {"id": "go", "do": {"all": {"goto": [1, 2]}}}
IF = {**GO, "if": {"role": "all", "event": "battery_low"}}
UNTIL = {"id": "again", "repeat": {"times": 2, "until": {"role": "feet", "event": "lost"}, "steps": [GO]}}


def first_line(yard):
    """Return how the story of the run begins."""
    lines = queue.Queue()
    yard.store.story("3f2a", lines.put)
    return lines.get(timeout=20)[0].text


@pytest.fixture
def two(yard):
    """Return an edge whose robot beast belongs to another edge."""
    yard.edge_of = {"beast": "barn"}
    return yard


@pytest.mark.parametrize("step", [WAIT, IF, UNTIL], ids=["wait_for", "if", "until"])
def test_an_event_of_a_robot_of_another_edge_is_not_waited_for_in_vain(two, step):
    ((run, _, refusal),) = two.start({**MISSION, "steps": [step]})
    assert run == ""
    assert f"step {step['id']}: yard receives no events of beast, a robot of barn" in refusal
    assert not two.robots["kestrel"].requests


def test_its_battery_and_events_of_our_own_robots_are(two):
    battery = {"role": "feet", "battery": {"min": 50}, "timeout": "1 min"}
    own = {"role": "eye", "event": "battery_low", "timeout": "1 min"}
    steps = [{"id": "full", "wait_for": battery}, {"id": "low", "wait_for": own}]
    ((run, _, refusal),) = two.start({**MISSION, "steps": steps})
    assert (run, refusal) == ("3f2a", "")


def test_a_place_is_not_taken_that_the_other_edge_does_not_keep_free(two):
    ((run, _, refusal),) = two.start({**MISSION, "occupies": ["gate"]})
    assert run == ""
    assert "gate: a place cannot be occupied on two edges, and beast of barn takes part" in refusal


def test_its_story_begins_with_the_robots_that_are_not_kept_apart(two):
    two.robots["kestrel"].be(separation="unknown to beast")
    two.start(MISSION)
    line = first_line(two)
    assert line == "Not kept apart from each other: kestrel: separation unknown to beast"


def test_its_story_says_nothing_of_robots_of_two_edges_that_are_kept_apart(two):
    two.start(MISSION)
    assert "apart" not in first_line(two)


def test_robots_of_one_edge_are_refused_nothing_and_reported_nothing(yard):
    ((run, _, _),) = yard.start({**MISSION, "occupies": ["gate"], "steps": [WAIT, GO]})
    assert run
    assert "apart" not in first_line(yard)
