import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bus.lane import Lane
from fleet.bus.session import Bus
from fleet.host.stops import names_in, take_stops

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
    bus = Bus(Lane(LONELY), Lane(LONELY))
    yield bus
    bus.close()


@pytest.fixture
def processes(bus):
    """Two processes of one edge, and one of another, on one bus."""
    processes = [Process("yard-1", "rex"), Process("yard-1", "beast"), Process("barn", "kestrel")]
    for process in processes:
        take_stops(process, bus, GROUPS)
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
    answers = bus.control.ask("fleet/*/stop", b'["yard"]', timeout=10.0, urgent=True)
    assert sorted(json.loads(answer) for _, answer in answers) == [[], ["beast"], ["rex"]]
    assert stopped(processes) == [["rex"], ["beast"], []]


@given(st.binary(max_size=50))
def test_no_bytes_keep_a_stop_from_being_read(payload):
    assert isinstance(names_in(payload, GROUPS), tuple)


@given(st.lists(st.text(max_size=8), min_size=1))
def test_names_never_come_to_mean_everything(names):
    assert set(names) <= set(names_in(json.dumps(names).encode(), GROUPS))


@pytest.mark.parametrize(("payload", "later"), [(b"", ["rex"]), (b'["yard"]', ["rex"]), (b'["kestrel"]', [])])
def test_a_robot_in_a_worker_that_may_not_hear_it_is_stopped_later(bus, payload, later):
    stopped = []

    class Elsewhere:
        name = "rex"

        def stop_later(self):
            stopped.append(self.name)

    take_stops(Process("yard-1"), bus, GROUPS, [Elsewhere()])
    bus.control.put("fleet/*/stop", payload)
    assert stopped[:1] == later
