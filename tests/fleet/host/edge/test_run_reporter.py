"""A run's start and end are in the history once, and its states on the bus for whoever wants them."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.edge.run_reporter import RunReporter
from fleet.missions.report import RunRobot, RunState
from fleet.model.command import Transport
from fleet.model.event import EventKind, Requester, Severity
from fleet.testing.clock import ManualClock

ANNA = Requester(Transport.BUS, "anna")
STATE = RunState(
    "3f2a",
    "yard",
    "patrol",
    "step",
    "up.1",
    1000.0,
    robots=(RunRobot("kestrel", "eye"), RunRobot("beast", "feet")),
)


class Bench:
    """A reporter, and what it reports in order."""

    def __init__(self):
        self.said = []
        self.wants = True
        self.reporter = RunReporter(
            "yard",
            self,
            lambda robot, event: self.said.append((robot, event)),
            lambda state: ANNA,
            ManualClock(),
        )
        self.reporter.listeners.append(lambda state: self.said.append("listener"))

    def publishers(self, pattern):
        assert pattern == keys.run("yard", "*")
        return self

    def wanted(self, key):
        self.key = key
        return self if self.wants else None

    def put(self, payload):
        self.said.append(msgspec.json.decode(payload, type=RunState))

    def report(self, **fields):
        """Report a state; return what is said."""
        self.said.clear()
        self.state = msgspec.structs.replace(STATE, **fields)
        self.reporter.report(self.state)
        return self.said

    def events(self, **fields):
        """Report a state; return the texts of the events in the history."""
        return [each[1].text for each in self.report(**fields) if isinstance(each, tuple)]


@pytest.fixture
def bench():
    return Bench()


def test_the_start_is_in_the_history_of_the_edge_with_who_asked_for_it(bench):
    (robot, event), listener, published = bench.report()
    assert (robot, event.kind, event.severity) == ("", EventKind.COMMAND, Severity.INFO)
    assert event.text == "mission patrol started: eye kestrel, feet beast"
    assert (event.asker, event.command, event.request) == (ANNA, "patrol", "3f2a")
    assert (listener, published, bench.key) == ("listener", bench.state, keys.run("yard", "3f2a"))


@pytest.mark.parametrize(("seconds", "how"), [(0.9, "started"), (1.0, "taken up again")])
def test_a_run_that_is_no_longer_new_was_taken_up_again(bench, seconds, how):
    assert bench.events(seconds=seconds) == [f"mission patrol {how}: eye kestrel, feet beast"]


def test_a_start_is_said_once_for_each_run(bench):
    bench.report()
    assert bench.events(phase="waiting") == []
    assert bench.events(run="77b0") == ["mission patrol started: eye kestrel, feet beast"]


@pytest.mark.parametrize(
    ("outcome", "reason", "severity", "text"),
    [
        ("completed", "", Severity.INFO, "mission patrol completed"),
        ("completed_with_losses", "", Severity.WARNING, "mission patrol completed_with_losses"),
        ("aborted", "aborted by anna", Severity.WARNING, "mission patrol aborted: aborted by anna"),
        ("failed", "so it was", Severity.WARNING, "mission patrol failed: so it was"),
    ],
)
def test_the_end_is_in_the_history_with_its_reason(bench, outcome, reason, severity, text):
    bench.report()
    (_, event), *_ = bench.report(outcome=outcome, reason=reason)
    assert (event.kind, event.severity, event.text) == (EventKind.OUTCOME, severity, text)
    assert event.asker == ANNA


def test_a_run_that_was_never_seen_going_has_both_its_start_and_its_end(bench):
    texts = bench.events(outcome="failed")
    assert texts == ["mission patrol started: eye kestrel, feet beast", "mission patrol failed"]


def test_who_listens_hears_after_the_history_and_before_the_bus(bench):
    first, second, third = bench.report()
    assert (first[0], second, third) == ("", "listener", bench.state)


def test_without_a_subscriber_nothing_goes_out_and_all_else_happens(bench):
    bench.wants = False
    assert [type(each).__name__ for each in bench.report()] == ["tuple", "str"]
