"""What a command makes of a robot's answers to its query: the data, a refusal, or no answer in time."""

import json

import pytest

from fleet.cli.robot_queries import RobotQuery, query_all
from fleet.errors import Refused, TimedOut
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

TAKEN = Reply("params", ReplyStatus.ACCEPTED)
DONE = Reply("params", ReplyStatus.ACCEPTED, done=True, data={"a": 1})


def robot(name):
    return RobotState(name, "t", "toy", "yard", 1.0)


class Edges:
    """Edges whose robots answer as the test says, by name; ``requests`` are what they are asked."""

    def __init__(self, **replies):
        self.replies, self.requests, self.read = replies, [], []

    def named(self, name):
        return [robot(each) for each in self.replies] if name == "pack" else [robot(name)]

    def command(self, state, payload, *, kind, wait, timeout):
        message = json.loads(payload)
        self.requests.append((state.name, message["command"], message["data"], kind, wait, timeout))
        return self._replies(state.name)

    def _replies(self, name):
        self.read.append(name)
        yield from self.replies[name]


def asked(*replies):
    return RobotQuery(Edges(rex=replies), "rex").request("params", timeout=5.0)


def test_a_query_waits_for_the_end_and_returns_its_data():
    assert asked(TAKEN, DONE) == {"a": 1}


def test_what_comes_after_the_end_does_not_count():
    assert asked(DONE, Reply("params", ReplyStatus.REJECTED, "late")) == {"a": 1}
    with pytest.raises(Refused, match="busy"):
        asked(Reply("params", ReplyStatus.REJECTED, "busy"), DONE)


NO_ANSWER = [
    ((), "no answer within 5 s"),
    ((TAKEN,), "no answer within 5 s"),
    ((Reply("params", ReplyStatus.TIMEOUT, "its worker is gone"),), "its worker is gone"),
    ((Reply("params", ReplyStatus.TIMEOUT),), "no answer within 5 s"),
    ((Reply("params", ReplyStatus.ACCEPTED, "it loads"),), "it loads"),
]


@pytest.mark.parametrize(("replies", "why"), NO_ANSWER)
def test_a_robot_that_does_not_end_it_has_timed_out(replies, why):
    with pytest.raises(TimedOut) as caught:
        asked(*replies)
    assert str(caught.value) == f"rex: params: {why}"


REFUSALS = [
    ((Reply("params", ReplyStatus.REJECTED, "it flies", hint="land it"),), "it flies"),
    ((Reply("params", ReplyStatus.DENIED, "it flies", hint="land it"),), "it flies"),
    ((TAKEN, Reply("params", ReplyStatus.ACCEPTED, "it fell", done=False, hint="land it")), "it fell"),
]


@pytest.mark.parametrize(("replies", "why"), REFUSALS)
def test_a_robot_that_refuses_or_fails_is_told_with_its_hint(replies, why):
    with pytest.raises(Refused) as caught:
        asked(*replies)
    assert (str(caught.value), caught.value.hint) == (f"rex: params: {why} (land it)", "land it")


def test_one_robot_is_asked_and_no_group():
    with pytest.raises(Refused, match=r"pack is a group \(name one robot\)"):
        RobotQuery(Edges(rex=(), max=()), "pack")


def test_a_request_has_the_data_of_the_command_and_the_time_at_which_it_is_sent():
    edges = Edges(rex=[DONE])
    RobotQuery(edges, "rex").request("params", {"name": "P"}, timeout=5.0)
    assert edges.requests == [("rex", "params", {"name": "P"}, "command", True, 5.0)]


def test_several_robots_are_asked_before_the_first_answer_is_read_and_each_has_its_own():
    edges = Edges(rex=[DONE], max=[Reply("params", ReplyStatus.REJECTED, "busy")])

    def command(state, *arguments, ask=edges.command, **how):
        assert edges.read == [], "all are asked first"
        return ask(state, *arguments, **how)

    edges.command = command
    rex, other = query_all(edges, [robot("rex"), robot("max")], "params", timeout=5.0)
    assert (rex.robot.name, rex.get()) == ("rex", {"a": 1})
    with pytest.raises(Refused, match="max: params: busy"):
        other.get()
