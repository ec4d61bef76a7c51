"""Queries of missions and runs are answered on the key that was asked, and each query is closed once."""

from collections import deque
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.config.missions import mission_of
from fleet.errors import Refused
from fleet.host.edge.mission_queries import SHOWN, MissionQueries
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState
from fleet.missions.state import Phase, RunHead, RunMember
from fleet.missions.store import RunLogEntry, RunOrigin
from fleet.model.command import Transport

GO = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "go", "do": {"eye": "walk"}}]}
ABORT = b'{"do": "abort", "session_id": "eve"}'


class Question:
    """A query; its replies by key, and how often it was closed."""

    def __init__(self, key, payload=b"", **parameters):
        self.requested, self.payload, self.parameters = key, payload, parameters
        self.replies, self.closed = [], 0

    def reply(self, payload, key):
        assert not self.closed
        self.replies.append((key, msgspec.json.decode(payload)))

    def close(self):
        self.closed += 1

    def answer(self, payload, key):
        self.reply(payload, key)
        self.close()


class Edge:
    """All that the queries of an edge ask, played: what reaches a part is kept in ``heard``."""

    def __init__(self):
        self.heard, self.loop, self.answers = [], deque(), {}
        self.active, self.past, self.story_of, self.refusal = [], [], {}, None
        missions = {name: mission_of(name, GO, {}, {}) for name in ("patrol", "dock")}
        known = SimpleNamespace(
            by_name=missions,
            requested=lambda name, request: self.heard.append(("made", name, request)) or name,
        )
        parts = {
            "runs": SimpleNamespace(states=lambda: self.active, control=self.control),
            "requesters": SimpleNamespace(start=self.request_of, control=self.permitted),
            "starts": SimpleNamespace(check=self.note("check"), begin=self.note("begin")),
            "rehearsals": SimpleNamespace(answer_state=self.note("state"), begin=self.note("rehearse")),
            "results": SimpleNamespace(answer=self.note("results")),
            "store": SimpleNamespace(story=self.story, ended=self.ended),
        }
        MissionQueries("yard", self, known, **parts, soon=self.loop.append).declare()

    def declare_queryable(self, key, call, *, more):
        assert more == keys.SENDER_SUFFIX
        self.answers[key] = call

    def note(self, what):
        return lambda *arguments: self.heard.append((what, *arguments))

    def request_of(self, question):
        return MissionStartRequest(run="r1")

    def permitted(self, question, run, request):
        if self.refusal:
            raise Refused(self.refusal)
        return msgspec.structs.replace(request, session_id="anna")

    def control(self, run, request, on_answer):
        self.heard.append((run, request))
        on_answer("" if run == "r1" else f"there is no run {run!r}")

    def story(self, run, then):
        then(self.story_of.get(run, []))

    def ended(self, most, then):
        then(self.past[:most])

    def ask(self, key, payload=b"", **parameters):
        """Ask, and let the loop do what is left to it."""
        question = Question(key, payload, **parameters)
        self.answers[keys.mission("yard", "*") if "missions" in key else keys.run("yard", "*")](question)
        while self.loop:
            self.loop.popleft()()
        return question


@pytest.fixture
def edge():
    return Edge()


@pytest.mark.parametrize(
    ("asked", "names"), [("*", ["patrol", "dock"]), ("dock", ["dock"]), ("nothing", []), ("patro", [])]
)
def test_missions_are_shown_each_on_its_own_key(edge, asked, names):
    question = edge.ask(keys.mission("yard", asked))
    assert [key for key, _ in question.replies] == [keys.mission("yard", name) for name in names]
    assert [(shown["name"], shown["edge"]) for _, shown in question.replies] == [
        (name, "yard") for name in names
    ]
    assert question.closed == 1


def test_a_start_begins_with_the_permitted_request_and_its_answer_has_the_robots(edge):
    question = edge.ask(keys.mission("yard", "patrol"), do="start")
    ((what, made, transport, began),) = edge.heard
    assert (what, transport, question.closed) == ("begin", Transport.BUS, 0)
    assert made() == ("patrol", MissionStartRequest(run="r1"))
    assert edge.heard[1] == ("made", "patrol", MissionStartRequest(run="r1"))
    began("r1", {"eye": ("rex", "max")}, "")
    answer = {"run": "r1", "roles": {"eye": ["rex", "max"]}}
    assert (question.replies, question.closed) == ([(keys.mission("yard", "patrol"), answer)], 1)


def test_a_start_that_is_refused_says_why(edge):
    question = edge.ask(keys.mission("yard", "patrol"), do="start")
    edge.heard[0][-1]("", {}, "rex is offline")
    assert question.replies == [(keys.mission("yard", "patrol"), {"refusal": "rex is offline"})]


def test_a_rehearsal_starts_nothing(edge):
    edge.ask(keys.mission("yard", "patrol"), do="rehearse")
    ((what, made, then, began),) = edge.heard
    assert (what, made()[0]) == ("check", "patrol")
    then("mission", "program", "request")
    question = edge.heard[-1][1]
    assert edge.heard[-1] == ("rehearse", question, "mission", "program", "request")
    began("", {}, "rex is offline")
    assert question.replies == [(keys.mission("yard", "patrol"), {"refusal": "rex is offline"})]


def test_the_state_of_a_rehearsal_is_told_on_the_loop(edge):
    question = edge.ask(keys.mission("yard", "patrol"), do="rehearsal")
    assert edge.heard == [("state", question)]


def test_a_run_is_controlled_by_the_name_that_its_permission_proved(edge):
    question = edge.ask(keys.run("yard", "r1"), ABORT)
    assert edge.heard == [("r1", RunControlRequest("abort", session_id="anna"))]
    assert (question.replies, question.closed) == ([(keys.run("yard", "r1"), {})], 1)


def test_a_run_that_is_not_there_is_answered_so(edge):
    question = edge.ask(keys.run("yard", "r9"), ABORT)
    assert question.replies == [(keys.run("yard", "r9"), {"refusal": "there is no run 'r9'"})]


def test_who_may_not_control_a_run_hears_why_and_the_run_hears_nothing(edge):
    edge.refusal = "vic may only look"
    question = edge.ask(keys.run("yard", "r1"), ABORT)
    assert (edge.heard, question.closed) == ([], 1)
    assert question.replies == [(keys.run("yard", "r1"), {"refusal": "vic may only look"})]


@pytest.mark.parametrize("payload", [b"{", b"{}", b'{"do": "explode"}', b"[]"])
def test_what_cannot_be_read_controls_nothing(edge, payload):
    question = edge.ask(keys.run("yard", "r1"), payload)
    ((_, answer),) = question.replies
    assert (bool(answer["refusal"]), edge.heard, question.closed) == (True, [], 1)


def test_the_log_of_a_run_needs_no_permission_to_control_it(edge):
    edge.refusal, edge.story_of = "vic may only look", {"r1": [RunLogEntry(1.0, "begun")]}
    question = edge.ask(keys.run("yard", "r1"), b'{"do": "log"}')
    assert question.replies == [(keys.run("yard", "r1"), [{"stamp": 1.0, "text": "begun"}])]
    other = edge.ask(keys.run("yard", "r2"), b'{"do": "log"}')  # a run of another edge, which answers
    assert (question.closed, other.closed, other.replies) == (1, 1, [])


def test_the_results_of_a_run_are_answered_by_their_keeper(edge):
    question = edge.ask(keys.run("yard", "r1"), b'{"do": "results"}')
    assert edge.heard == [("results", question, keys.run("yard", "r1"), "r1")]
    assert (question.replies, question.closed) == ([], 0)


def state(run):
    return RunState(run, "yard", "patrol", "running", "go", 1.0)


def past(run):
    return RunOrigin(run, "patrol", "", 1.0), RunHead(Phase.ENDED), [RunMember("rex", "eye", 0)]


@pytest.mark.parametrize(
    ("asked", "runs"), [("*", ["r3", "r2", "r1"]), ("r1", ["r1"]), ("r2", ["r2"]), ("r3", ["r3"]), ("r", [])]
)
def test_running_runs_come_before_ended_ones_and_each_once(edge, asked, runs):
    """A run that has just ended may be in both."""
    edge.active, edge.past = [state("r3"), state("r2")], [past("r2"), past("r1")]
    question = edge.ask(keys.run("yard", asked))
    assert [key for key, _ in question.replies] == [keys.run("yard", run) for run in runs]
    phases = {shown["run"]: shown["phase"] for _, shown in question.replies}
    assert phases == {run: "ended" if run == "r1" else "running" for run in runs}
    assert question.closed == 1


def test_as_many_ended_runs_are_shown_as_people_read(edge):
    edge.past = [past(f"r{each}") for each in range(SHOWN + 1)]
    assert len(edge.ask(keys.run("yard", "*")).replies) == SHOWN
