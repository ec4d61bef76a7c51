"""Heartbeats say how the computer is; the notice of a death follows the twins that the edge serves."""

import msgspec
import pytest

from fleet.bridge.disconnect_program import DisconnectPlan
from fleet.cloud.values import CloudSettings
from fleet.health.load import HostLoad
from fleet.host.edge import cloud_presence
from fleet.host.edge.cloud_presence import CloudPresence
from fleet.model.state import EdgeState, RobotState

EDGE = EdgeState("yard", "0", 1.0, 5.0)
REX = RobotState("rex", "t1", "toy", "yard", 1.0)


class Bridge:
    """A bridge that notes its heartbeats; it serves two twins, and leaves those that are held."""

    def __init__(self):
        self.held, self.beats = {}, []

    def disconnect_plan(self):
        topics = tuple(twin for twin in ("t1", "t2") if twin not in self.held)
        return DisconnectPlan(CloudSettings(host="broker", client_id="us"), "session", topics)

    def set_holder(self, twin, holder):
        if holder == self.held.get(twin, ""):
            return False
        self.held = {other: one for other, one in self.held.items() if other != twin}
        self.held |= {twin: holder} if holder else {}
        return True

    def beat(self, extra, edge, robots):
        self.beats.append((extra, edge, list(robots)))


class Bench:
    def __init__(self):
        self.bridge, self.notices = Bridge(), []
        self.presence = CloudPresence(self.bridge, self)

    def leave_notice(self, notice):
        self.notices.append(tuple(msgspec.json.decode(notice)["topics"]))


def test_a_supervisor_has_the_messages_for_all_twins_that_are_served():
    bench = Bench()
    bench.presence.register_disconnect_messages()
    assert bench.notices == [("t1", "t2")]


def test_the_death_of_an_edge_says_nothing_of_a_twin_that_it_left_until_it_has_it_again():
    bench = Bench()
    for twin, holder in (("t1", "barn"), ("t1", "barn"), ("t1", "attic"), ("t1", ""), ("t1", "")):
        bench.presence.set_holder(twin, holder)
    assert bench.notices == [("t2",), ("t2",), ("t1", "t2")]


LOADS = [
    (HostLoad(), {}),
    (HostLoad(load=0.5, threads=7), {}),
    (
        HostLoad(memory_percent=81.5, memory_available_mb=512.0, cpu_temperature=0.0),
        {"host_memory_percent": 81.5, "host_memory_available_mb": 512.0, "cpu_temp_c": 0.0},
    ),
    (HostLoad(cpu_temperature=-5.0), {"cpu_temp_c": -5.0}),
]


@pytest.mark.parametrize(("load", "told"), LOADS)
def test_a_heartbeat_has_the_figures_that_the_computer_knows(load, told, monkeypatch):
    monkeypatch.setattr(cloud_presence, "read_load", lambda: load)
    bench = Bench()
    bench.presence.beat(EDGE, [REX])
    assert bench.bridge.beats == [(told, EDGE, [REX])]
