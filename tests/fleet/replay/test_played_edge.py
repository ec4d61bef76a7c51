"""A recorded edge on a bus of its own: its states are of now, under another name, and nothing moves there."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.missions.report import RunState
from fleet.model.command import Reply, ReplyStatus
from fleet.model.event import EventKind
from fleet.model.report import BatteryReport
from fleet.model.state import EdgeState, RobotState
from fleet.record.reading import ReadMessage
from fleet.replay import played_edge
from fleet.replay.played_edge import PlayedEdge
from fleet.testing.clock import ManualClock

THEN = 1_700_000_000.0  # Unix s
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
REX = RobotState("rex", TWIN, "ugv", "yard", THEN, "ok")


class Bus:
    """A bus: what was put on it, who answers what, and what was reported."""

    def __init__(self):
        self.control = self.reports = self
        self.puts, self.answers, self.tokens, self.sent, self.open = {}, {}, [], [], True
        self.pending = []

    def put(self, key, payload):
        self.puts[key] = payload

    def declare_queryable(self, key, call):
        self.answers[key] = call

    def token(self, key):
        self.tokens.append(key)

    def close(self):
        self.open = False

    def sender(self, twin):
        return lambda report: self.pending.append((twin, report))

    def flush(self):
        self.sent += self.pending
        self.pending = []


class Question:
    def __init__(self, requested, payload=b""):
        self.requested, self.payload, self.replies, self.closed = requested, payload, [], 0

    def reply(self, payload, key=None):
        assert not self.closed
        self.replies.append((key, payload))

    def close(self):
        self.closed += 1


class Bench:
    def __init__(self, folder, monkeypatch):
        self.bus, self.clock = Bus(), ManualClock()
        self.opened = []
        monkeypatch.setattr(played_edge, "open_edge", lambda *how: self.opened.append(how) or self.bus)
        monkeypatch.setattr(played_edge, "ReportQueue", lambda bus: bus)
        self.edge = PlayedEdge("yard", folder, self.clock)

    def play(self, value, *, robot="rex", schema=None):
        data = value if isinstance(value, bytes) else msgspec.json.encode(value)
        schema = schema or f"fleet.{type(value).__name__}"
        self.edge.play(ReadMessage(f"/yard/{robot}/x", schema, THEN, THEN, data))

    def ask(self, pattern, requested, payload=b""):
        """Ask the answerer of a pattern; return the replies."""
        question = Question(requested, payload)
        self.bus.answers[pattern](question)
        assert question.closed == 1
        return question.replies

    def last(self, key, kind):
        return msgspec.json.decode(self.bus.puts[key], type=kind)


@pytest.fixture
def bench(tmp_path, monkeypatch):
    return Bench(tmp_path, monkeypatch)


def test_it_is_an_edge_of_another_name_on_a_bus_that_connects_to_nothing(bench, tmp_path):
    ((settings, folder),) = bench.opened
    assert (settings.edge, settings.connect, settings.listen, folder) == ("replay-yard", (), (), tmp_path)
    assert (bench.edge.name, bench.bus.tokens) == ("replay-yard", [keys.edge("replay-yard")])
    bench.edge.close()
    assert not bench.bus.open


def test_the_state_of_a_robot_is_of_now_of_this_edge_and_simulated(bench):
    bench.play(REX)
    state = bench.last(keys.state("replay-yard", "rex"), RobotState)
    assert (state.edge, state.simulated, state.stamp) == ("replay-yard", True, bench.clock.time())
    assert (state.twin, state.health) == (TWIN, "ok")


def test_the_states_of_the_edge_and_of_its_runs_are_told_too(bench):
    bench.play(EdgeState("yard", "1", THEN, 5.0, cloud="ok"))
    bench.play(RunState("r1", "yard", "patrol", "running", "go", THEN))
    edge = bench.last(keys.health("replay-yard"), EdgeState)
    run = bench.last(keys.run("replay-yard", "r1"), RunState)
    assert (edge.edge, edge.stamp, edge.cloud) == ("replay-yard", bench.clock.time(), "ok")
    assert (run.edge, run.started) == ("replay-yard", THEN)


def test_who_asks_later_hears_the_last_states_that_match(bench):
    for name in ("rex", "max"):
        bench.play(msgspec.structs.replace(REX, name=name, mode="MANUAL"))
        bench.play(msgspec.structs.replace(REX, name=name, mode="AUTO"))
    pattern = keys.state("replay-yard", "*")
    found = bench.ask(pattern, keys.state("*", "*"))
    assert {key: msgspec.json.decode(payload)["mode"] for key, payload in found} == {
        keys.state("replay-yard", "rex"): "AUTO",
        keys.state("replay-yard", "max"): "AUTO",
    }
    assert [key for key, _ in bench.ask(pattern, keys.state("*", "max"))] == [
        keys.state("replay-yard", "max")
    ]
    assert bench.ask(pattern, keys.state("yard", "*")) == []


def test_a_report_goes_out_under_the_twin_of_its_robot_with_the_time_of_now(bench):
    bench.play(BatteryReport(THEN, 50.0))
    bench.edge.flush()
    assert bench.bus.sent == [], "its twin is not known yet"
    bench.play(REX)
    bench.play(BatteryReport(THEN, 49.0))
    bench.play(BatteryReport(THEN, 48.0), robot="nobody")
    assert bench.bus.sent == []
    bench.edge.flush()
    assert bench.bus.sent == [(TWIN, BatteryReport(bench.clock.time(), 49.0))]


def test_what_is_no_report_is_not_played(bench):
    bench.play(REX)
    bench.play({"value": []}, schema="fleet.Document")
    bench.edge.flush()
    assert (bench.bus.sent, len(bench.bus.puts)) == ([], 1)


@pytest.mark.parametrize("schema", ["fleet.RobotState", "fleet.EdgeState", "fleet.RunState", "fleet.Record"])
@pytest.mark.parametrize("data", [b"{", b"[]", b"{}"])
def test_a_damaged_message_is_told_and_the_next_one_is_played(bench, caplog, schema, data):
    bench.play(data, schema=schema)
    assert "/yard/rex/x: " in caplog.text
    bench.play(REX)
    assert list(bench.bus.puts) == [keys.state("replay-yard", "rex")]


def test_a_damaged_report_is_told(bench, caplog):
    bench.play(REX)
    bench.play(b'{"stamp": "never"}', schema="fleet.BatteryReport")
    assert "/yard/rex/x: " in caplog.text


HISTORY = keys.history("replay-yard")


def events(bench, payload=b""):
    ((_, answer),) = bench.ask(HISTORY, HISTORY, payload)
    return msgspec.json.decode(answer, type=list[Record])


def test_its_history_has_the_events_that_were_played_with_their_own_time(bench):
    assert events(bench) == []
    for second, robot in enumerate(("rex", "max")):
        bench.play(Record(THEN + second, robot, EventKind.STOP, "stopped", edge="yard"))
    assert [(one.stamp, one.robot, one.edge) for one in events(bench)] == [
        (THEN, "rex", ""),
        (THEN + 1, "max", ""),
    ]
    wanted = msgspec.json.encode(EventFilter(robots=("max",)))
    assert [one.robot for one in events(bench, wanted)] == ["max"]


def test_its_history_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(played_edge, "REMEMBERED", 2)
    bench = Bench(tmp_path, monkeypatch)
    for second in range(3):
        bench.play(Record(THEN + second, "rex", EventKind.STOP, "stopped"))
    assert [one.stamp for one in events(bench)] == [THEN + 1, THEN + 2]


def test_a_question_that_cannot_be_read_is_closed_without_an_answer(bench, caplog):
    assert bench.ask(HISTORY, HISTORY, b"{") == []
    assert "a question for the history was not answered" in caplog.text


def test_a_command_to_a_robot_is_refused_on_the_key_on_which_it_came(bench):
    key = keys.command("replay-yard", "rex")
    ((answered, payload),) = bench.ask(keys.command("replay-yard", "*"), key, b'{"command": "walk"}')
    reply = msgspec.json.decode(payload, type=Reply)
    assert (answered, reply.status) == (key, ReplyStatus.REJECTED)
    assert reply.reason == "this is a recording that is played again: nothing here moves"
