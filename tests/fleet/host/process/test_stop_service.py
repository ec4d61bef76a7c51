import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bus.bus import Bus
from fleet.bus.zenoh_session import ZenohSession
from fleet.host.process.stop_service import names_in, serve_stops, stop_everywhere
from fleet.host.requests.stop_cause import STOP_KEY_CAUSE, StopCause, cause_noted, local_cause, note_of
from fleet.model.command import Transport
from fleet.model.event import Requester

GROUPS = {"yard": ["rex", "beast"], "none": []}
LONELY = {"mode": "peer", "listen/endpoints": [], "scouting/multicast/enabled": False}


class Process:
    """What a stop needs of a process."""

    def __init__(self, edge, *robots):
        self.edge = edge
        self.robots = robots
        self.stopped = []

    def stop_robots(self, names, why):
        assert why
        stopped = [name for name in self.robots if not names or name in names]
        self.stopped += stopped
        return stopped


@pytest.fixture
def bus():
    bus = Bus(ZenohSession(LONELY), ZenohSession(LONELY))
    yield bus
    bus.close()


@pytest.fixture
def processes(bus):
    """Two processes of one edge, and one of another, on one bus."""
    processes = [Process("yard-1", "rex"), Process("yard-1", "beast"), Process("barn", "kestrel")]
    for process in processes:
        serve_stops(process, bus, GROUPS)
    return processes


def stopped(processes):
    return [process.stopped for process in processes]


@pytest.mark.parametrize("payload", [b"", b"[]"])
def test_a_stop_without_names_stops_everything(bus, processes, payload):
    bus.control.put("fleet/*/stop", payload, urgent=True)
    assert stopped(processes) == [["rex"], ["beast"], ["kestrel"]]


def test_a_stop_for_an_edge_leaves_the_others_alone(bus, processes):
    bus.control.put("fleet/yard-1/stop", b"")
    assert stopped(processes) == [["rex"], ["beast"], []]


def test_a_stop_for_a_robot_leaves_the_others_alone(bus, processes):
    bus.control.put("fleet/*/stop", b'["beast"]')
    assert stopped(processes) == [[], ["beast"], []]


def test_a_stop_for_a_group_stops_its_robots(bus, processes):
    bus.control.put("fleet/*/stop", b'["yard", "kestrel"]')
    assert stopped(processes) == [["rex"], ["beast"], ["kestrel"]]


def test_a_stop_for_a_group_without_robots_stops_nobody(bus, processes):
    bus.control.put("fleet/*/stop", b'["none"]')
    assert stopped(processes) == [[], [], []]


def test_a_stop_is_taken_on_the_reports_lane_too(bus, processes):
    bus.reports.put("fleet/*/stop", b'["rex"]')
    assert stopped(processes) == [["rex"], [], []]


@pytest.mark.parametrize(
    "payload", [b"rex", b'"rex"', b'{"robot": "rex"}', b'["rex", 5]', b'["rex"', b"\xff\x00", b"null"]
)
def test_a_stop_that_cannot_be_read_stops_everything(bus, processes, payload):
    bus.control.put("fleet/*/stop", payload)
    assert stopped(processes) == [["rex"], ["beast"], ["kestrel"]]


def test_whoever_asks_hears_from_each_process_whom_it_stopped(bus, processes):
    answers = bus.control.request("fleet/*/stop", b'["yard"]', timeout=60.0, urgent=True)
    assert sorted(json.loads(answer) for _, answer in answers) == [[], ["beast"], ["rex"]]
    assert stopped(processes) == [["rex"], ["beast"], []]


@given(st.binary(max_size=50))
def test_no_bytes_keep_a_stop_from_being_read(payload):
    assert isinstance(names_in(payload, GROUPS), tuple)


@given(st.lists(st.text(max_size=8), min_size=1))
def test_names_never_come_to_mean_everything(names):
    assert set(names) <= set(names_in(json.dumps(names).encode(), GROUPS))


class Elsewhere:
    """A robot of a worker: the causes of the stops that it is told of, and how."""

    name = "rex"

    def __init__(self):
        self.calls = []

    def stop_later(self, cause):
        self.calls.append(("later", cause))

    def emergency(self, cause):
        self.calls.append(("now", cause))


ANNA = local_cause("anna", "smoke", "r1")
WHOM = pytest.mark.parametrize(
    ("payload", "expected"), [(b"", True), (b'["yard"]', True), (b'["kestrel"]', False)]
)


@WHOM
def test_a_robot_in_a_worker_that_may_not_hear_it_is_stopped_later(bus, payload, expected):
    robot = Elsewhere()
    serve_stops(Process("yard-1"), bus, GROUPS, [robot])
    bus.control.put("fleet/*/stop", payload)
    assert robot.calls[:1] == [("later", STOP_KEY_CAUSE)] * expected


@WHOM
def test_a_stop_that_comes_by_the_supervisor_is_put_on_for_a_robot_in_a_worker(bus, payload, expected):
    robot = Elsewhere()
    stop = serve_stops(Process("yard-1", "beast"), bus, GROUPS, [robot])
    assert stop(payload, ANNA) == ["beast"] * expected
    assert robot.calls == [("now", ANNA)] * expected


def test_robots_are_stopped_though_the_stop_of_one_in_a_worker_cannot_be_kept(bus, caplog):
    class Broken(Elsewhere):
        def stop_later(self, cause):
            raise RuntimeError("the table is full")

    process, robot = Process("yard-1", "beast"), Elsewhere()
    serve_stops(process, bus, GROUPS, [Broken(), robot])
    bus.control.put("fleet/*/stop", b"")
    assert process.stopped
    assert robot.calls[:1] == [("later", STOP_KEY_CAUSE)]
    assert "the stop of rex could not be kept" in caplog.text


def test_a_robot_in_a_worker_is_stopped_though_the_stop_fails_here(bus, caplog):
    class Broken(Process):
        def stop_robots(self, names, why):
            raise RuntimeError("the loop is closed")

    robot = Elsewhere()
    assert stop_everywhere(Broken("yard-1"), [robot], (), ANNA) == []
    assert robot.calls == [("now", ANNA)]
    assert "the emergency stop failed in this process" in caplog.text


def test_a_published_stop_says_who_asks_and_why(bus):
    robot = Elsewhere()
    serve_stops(Process("yard-1"), bus, GROUPS, [robot])
    bus.control.put("fleet/*/stop", b"", urgent=True, note=note_of(ANNA))
    assert robot.calls[0] == (
        "later",
        StopCause(Requester(Transport.LOCAL, "anna", proven=False), "smoke", "r1"),
    )


@pytest.mark.parametrize(
    "note", [b"", b"{", b"[]", b'{"asker": {"way": "nowhere"}}', b"\xff", b"[" * 5000, b" " * (1 << 20)]
)
def test_a_stop_whose_cause_cannot_be_read_is_a_stop(bus, processes, note):
    bus.control.put("fleet/*/stop", b"", urgent=True, note=note)
    assert stopped(processes) == [["rex"], ["beast"], ["kestrel"]]
    assert cause_noted(note) == STOP_KEY_CAUSE


def test_a_cause_that_cannot_be_written_is_cut_or_left_out():
    assert (
        cause_noted(note_of(StopCause(Requester(Transport.CLOUD, "\ud800")))).asker.transport
        is Transport.CLOUD
    )
    assert note_of(StopCause(Requester(Transport.CLOUD, 5))) == b""
    assert (
        len(note_of(StopCause(Requester(Transport.CLOUD, "a" * 100_000), "b" * 100_000, "c" * 100_000)))
        < 2000
    )
