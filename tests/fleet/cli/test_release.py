"""A release shows who set each stop, when and why, and releases only robots that are stopped."""

import contextlib
import json

import pytest

from fleet.cli import release as module
from fleet.cli.times import when
from fleet.history.record import Record
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, Requester
from fleet.model.state import RobotState

RELEASED = Reply("release_emergency_stop", ReplyStatus.ACCEPTED)
ANNA = Requester(Transport.LOCAL, "anna", proven=True)


def robot(name, why="", *, edge="yard", stopped=True):
    return RobotState(name, "t", "toy", edge, 1.0, emergency_stop=stopped, stop_cause=why)


def stop(name, edge="yard", asker=ANNA, **data):
    kind, command = EventKind.EMERGENCY_STOP, "emergency_stop"
    return Record(1000.0, name, kind, "stopped", asker=asker, command=command, data=data, edge=edge)


class Edges(contextlib.AbstractContextManager):
    """Edges with robots and a history; ``asked`` are the commands that they get."""

    def __init__(self, *robots, records=(), replies=None):
        self.robots, self.records, self.replies = list(robots), records, replies or {}
        self.asked, self.looked = [], []

    def reach(self, _file):
        return self

    def __exit__(self, *_):
        pass

    def states(self):
        return self.robots

    def named(self, name):
        return [state for state in self.robots if name in (state.name, "pack")]

    def history(self, wanted):
        self.looked.append(sorted(wanted.robots))
        return self.records

    def command(self, state, payload, **how):
        self.asked.append((state.name, json.loads(payload)["command"], how["wait"]))
        return iter(self.replies.get(state.name, [RELEASED]))


@pytest.fixture
def release(fleet, monkeypatch):
    def release(edges, *arguments):
        monkeypatch.setattr(module, "Edges", edges)
        return fleet("release", *arguments)

    return release


def test_a_stopped_robot_is_released_after_its_cause_was_shown(release):
    edges = Edges(robot("rex"), records=[stop("rex", reason="smoke")])
    result = release(edges, "rex")
    assert result.code == 0
    assert result.out.splitlines() == [
        f"rex: stopped by anna (proven, local), {when(1000.0)}: smoke",
        "rex: release_emergency_stop accepted",
    ]
    assert edges.asked == [("rex", "release_emergency_stop", False)]
    assert edges.looked == [["rex"]]


CAUSES = [
    (robot("rex", "button"), [], "stopped: button"),
    (robot("rex"), [], "stopped: cause unknown"),
    (robot("rex", "button"), [stop("rex")], f"stopped by anna (proven, local), {when(1000.0)}: button"),
    (robot("rex"), [stop("rex")], f"stopped by anna (proven, local), {when(1000.0)}: stopped"),
    (robot("rex"), [stop("rex", asker=None)], f"stopped by -, {when(1000.0)}: stopped"),
    (robot("rex", "button"), [stop("rex", edge="barn")], "stopped: button"),
]


@pytest.mark.parametrize(("state", "records", "words"), CAUSES)
def test_a_cause_is_as_good_as_what_is_known_of_it(release, state, records, words):
    assert release(Edges(state, records=records), "rex").out.splitlines()[0] == f"rex: {words}"


def test_a_robot_that_is_not_stopped_is_left_alone_and_named(release):
    edges = Edges(robot("rex", stopped=False))
    result = release(edges, "rex")
    assert (result.code, result.out, edges.asked, edges.looked) == (0, "", [], [])
    assert result.err == "rex: no emergency stop is set\nno robot needs a release\n"


def test_all_are_those_that_are_stopped(release):
    edges = Edges(robot("rex"), robot("max", stopped=False), robot("arm"))
    result = release(edges, "--all")
    assert [name for name, *_ in edges.asked] == ["rex", "arm"]
    assert (result.code, result.err) == (0, "2 of 2 ok\n")


def test_a_robot_that_is_named_twice_is_released_once(release):
    edges = Edges(robot("rex"), robot("max"))
    release(edges, "rex", "pack")
    assert [name for name, *_ in edges.asked] == ["rex", "max"]


def test_robots_that_do_not_obey_are_told_and_counted(release):
    refusal = Reply("release_emergency_stop", ReplyStatus.REJECTED, "stop input button holds it")
    edges = Edges(*map(robot, ("rex", "max", "arm")), replies={"max": [refusal], "arm": []})
    result = release(edges, "--all")
    assert result.code == 7
    assert "max: release_emergency_stop rejected: stop input button holds it" in result.out
    assert "1 of 3 ok; not known: arm; refused or failed: max" in result.err


def test_programs_get_the_cause_and_the_answer_of_each(release):
    edges = Edges(robot("rex", "button"), robot("max"), records=[stop("max", reason="smoke")])
    rex, other = release(edges, "--all", "--json").json["released"]
    assert (rex["robot"], rex["edge"], rex["why"], rex["stopped"]) == ("rex", "yard", "button", None)
    assert (rex["status"], other["stopped"]["data"]) == ("accepted", {"reason": "smoke"})


@pytest.mark.parametrize("arguments", [(), ("rex", "--all")])
def test_either_robots_or_all_are_named(release, arguments):
    edges = Edges(robot("rex"))
    result = release(edges, *arguments)
    assert (result.code, edges.asked) == (2, [])
    assert "name the robots to release, or --all" in result.err
