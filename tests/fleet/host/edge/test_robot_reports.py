"""Reports of robots on the bus reach the runs: events of all, goals and pictures of those in workers."""

import json

import pytest

from fleet.host.edge.robot_reports import RobotReports
from fleet.model.event import EventReport
from fleet.model.report import NavigationReport, PhotoReport
from fleet.wire.topics import data_key

EVENT, GOAL, PICTURE = EventReport.channel, NavigationReport.channel, PhotoReport.channel

T1, T2, T3 = (f"6f0c9a1e-0000-4000-8000-00000000000{number}" for number in (1, 2, 3))


class Bench:
    """The receiver, on a bus that passes on what is sent."""

    def __init__(self):
        self.heard = []
        self.subscribed = {}
        self.reports = RobotReports(
            lambda robot, kind: self.heard.append((robot, kind)),
            lambda sample: self.heard.append(("goal", sample)),
            lambda twin: lambda sample: self.heard.append((f"picture of {twin}", sample)),
        )

    def subscribe_many(self, pattern, calls):
        assert pattern not in self.subscribed, "once for each channel"
        self.subscribed[pattern] = calls

    def send(self, twin, channel, sample):
        """Send a sample; return what is heard of it."""
        self.heard.clear()
        for calls in self.subscribed.values():
            if data_key(twin, channel) in calls:
                calls[data_key(twin, channel)](sample)
        return list(self.heard)


def event(**fields):
    return json.dumps({"event_type": "person_seen"} | fields).encode()


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("before", [True, False], ids=["before", "after"])
def test_events_of_a_robot_are_heard_whenever_it_joins(bench, before):
    if before:
        bench.reports.join("rex", T1, remote=False)
    bench.reports.listen(bench)
    if not before:
        bench.reports.join("rex", T1, remote=False)
    assert bench.send(T1, EVENT, event()) == [("rex", "person_seen")]
    assert list(bench.subscribed) == [f"cw/*/data/{EVENT}"], "and no channel that nobody needs"


def test_goals_and_pictures_of_a_robot_in_a_worker_are_heard_too(bench):
    bench.reports.listen(bench)
    bench.reports.join("ada", T2, remote=True)
    bench.reports.join("max", T3, remote=True)
    assert bench.send(T2, GOAL, b"1") == [("goal", b"1")]
    assert bench.send(T3, PICTURE, b"2") == [(f"picture of {T3}", b"2")]
    assert len(bench.subscribed) == 3


def test_a_robot_that_leaves_is_not_heard_and_one_of_its_twin_is(bench):
    bench.reports.listen(bench)
    bench.reports.join("ada", T2, remote=True)
    bench.reports.leave(T2)
    assert [bench.send(T2, channel, event()) for channel in (EVENT, GOAL, PICTURE)] == [[], [], []]
    bench.reports.join("max", T2, remote=False)
    assert bench.send(T2, EVENT, event()) == [("max", "person_seen")]
    assert bench.send(T2, GOAL, b"1") == [], "it is in no worker any more"


def test_a_robot_that_moves_out_of_its_worker_is_heard_as_it_is_now(bench):
    bench.reports.listen(bench)
    bench.reports.join("ada", T2, remote=True)
    bench.reports.join("ada", T2, remote=False)
    assert bench.send(T2, GOAL, b"1") == []


@pytest.mark.parametrize("sample", [b"", b"no json", b"[]", b"{}", b'{"event_type": 7}'])
def test_what_cannot_be_read_is_no_event(bench, sample):
    bench.reports.listen(bench)
    bench.reports.join("rex", T1, remote=False)
    assert bench.send(T1, EVENT, sample) == []
