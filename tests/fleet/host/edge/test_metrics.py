import asyncio
import socket

import pytest

from fleet.bridge.bridge import Bridge, BridgeRules
from fleet.clock import SystemClock
from fleet.cloud.values import CloudMessage, CloudSettings
from fleet.errors import MetricsError
from fleet.host.edge.metrics import Metrics
from fleet.model.command import Reply, ReplyStatus, Request
from fleet.model.state import EdgeState, RobotState
from fleet.model.summary import Summary, Trouble
from fleet.spool.message import Outgoing
from fleet.wire.rulebook import rulebook, twin_rules
from fleet.wire.rules import TrafficClass
from fleet.wire.topics import Topics
from tests.tools.scraping import scraped

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


class Rex:
    name, twin, source_type, legacy_status = "rex", TWIN, "edge", True

    def read(self, kind, payload, *, transport, request_id="", waits=False, unread=""):
        return Request(lambda answer: answer(Reply("takeoff", ReplyStatus.DENIED, "no GPS")))


class Summarised:
    newest = Summary(
        *("yard-1", "0", 100.0, 5.0),
        robots={"ok": 1},
        troubles=(Trouble("offline", "silent for 3 s", 90.0, 2, "ugv", "can:can0", ("a", "b")),),
    )


class FakeEdge:
    """An edge whose bridge has carried a few things."""

    summaries = Summarised

    def __init__(self):
        self.bridge = Bridge(
            CloudSettings(host="127.0.0.1", tls=False, client_id="us"),
            Topics(""),
            {TWIN: Rex()},
            edge="yard-1",
            rules=BridgeRules({TWIN: twin_rules(rulebook())}),
            put=lambda *_: None,
            alive=lambda _name: True,
            claimed=lambda *_: None,
            clock=SystemClock(),
        )
        self.bridge.uplink.arrived(f"cw/{TWIN}/data/battery", b'{"ts": 1, "charge_pct": 50}')
        self.bridge.uplink.arrived(f"cw/{TWIN}/data/battery", b'{"ts": 2, "charge_pct": 50}')
        self.bridge.uplink.arrived(f"cw/{TWIN}/data/imu", b"garbage")
        list(self.bridge.tick())
        topic = f"cyberwave/twin/{TWIN}/command"
        self.bridge.downlink.arrived([CloudMessage(topic, b"{}"), CloudMessage(topic, b"{}", retain=True)])
        self.bridge.downlink.dispatch()

    def state(self):
        return EdgeState("yard-1", "0", 1.0, 5.0, threads=7)

    def states(self):
        return [RobotState("rex", TWIN, "toy", "yard-1", 1.0, health="ok", battery=50.0)]


@pytest.fixture
def metrics():
    metrics = Metrics(FakeEdge())
    yield metrics
    metrics.close()
    metrics._edge.bridge.client.close()


def read(metrics):
    """Return every sample by name and labels."""
    return scraped(metrics.port)


def test_a_scraper_reads_what_was_carried_by_class_and_refused_by_reason(metrics):
    metrics.serve("127.0.0.1", 0)
    seen = read(metrics)
    assert seen["fleet_outward_received_total", "latest"] == 2
    assert seen["fleet_outward_conflated_total", "latest"] == 1
    assert seen["fleet_outward_sent_total", "latest"] == 1
    assert seen["fleet_outward_sent_total", "reply"] == 1
    assert seen["fleet_outward_dropped_total", "stream"] == 0
    assert seen["fleet_refused_total", "unreadable"] == 1
    assert seen["fleet_refused_total", "retained"] == 1
    assert seen["fleet_inward_received_total", "command"] == 1
    assert seen["fleet_commands_answered_total", "denied"] == 1
    assert seen["fleet_command_latency_seconds_count", "rex"] == 1
    assert seen["fleet_command_latency_seconds_bucket", "+Inf", "rex"] == 1
    assert seen["fleet_robot_up", "ok", "rex"] == 1
    assert seen["fleet_robot_battery_percent", "rex"] == 50
    assert seen["fleet_edge_robots", "yard-1", "ok"] == 1
    assert seen["fleet_edge_robots", "yard-1", "fault"] == 0
    assert seen["fleet_trouble_robots", "silent for # s", "yard-1", "ugv", "offline", "can:can0"] == 2
    assert seen["fleet_cloud_window_messages",] == 0
    assert ("fleet_cloud_round_trip_seconds",) not in seen, "unknown is no zero"


def test_a_scraper_reads_what_waits_for_the_cloud_how_old_it_is_and_what_was_lost(metrics):
    spool = metrics._edge.bridge.client.spool
    for size in (10, 20):
        spool.put(Outgoing("t", b"x" * size, 1, TrafficClass.STATUS))
    spool.put(Outgoing("short", b"x", 1, TrafficClass.EVENT, expiry=0.0))
    spool.tick()
    metrics.serve("127.0.0.1", 0)
    seen = read(metrics)
    assert seen["fleet_spool_messages", "status"] == 2
    assert seen["fleet_spool_memory_bytes", "status"] == 30
    assert seen["fleet_spool_on_disk_messages", "status"] == 0
    assert 0 < seen["fleet_spool_oldest_age_seconds", "status"] < 60
    assert seen["fleet_spool_oldest_age_seconds", "event"] == 0
    assert seen["fleet_spool_lost_total", "age", "event"] == 1
    assert seen["fleet_spool_held_topics",] == 0
    assert seen["fleet_spool_disk_bytes",] == 0, "this one is in memory alone"
    assert seen["fleet_spool_disk_works",] == 1


def test_a_port_that_is_taken_is_said(metrics):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(MetricsError, match=f"metrics: 127.0.0.1:{port} cannot be opened"):
            metrics.serve("127.0.0.1", port)


async def test_an_edge_serves_its_figures_when_asked_and_opens_no_port_otherwise(yard, run_edge, requests):
    place = yard(rex={"worker": "main"})
    place.change(metrics={"port": 0})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.metrics.port)
        await requests.until(lambda: edge.states()[0].health == "ok")
        seen = await asyncio.to_thread(read, edge.metrics)
        assert seen["fleet_robot_up", "ok", "rex"] == 1
    place.change(metrics=None)
    quiet = place.edge()
    async with run_edge(quiet):
        assert quiet.metrics is None


async def test_a_taken_port_costs_the_figures_and_not_the_edge_until_it_is_free(
    yard, run_edge, requests, monkeypatch
):
    monkeypatch.setattr("fleet.host.edge.edge.METRICS_EVERY", 0.1)
    place = yard(rex={"worker": "main"})
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        place.change(metrics={"port": port})
        edge = place.edge()
        async with run_edge(edge):
            await requests.until(lambda: place.words("rex") == ["run"])
            await requests.until(lambda: f"metrics: 127.0.0.1:{port} cannot be opened" in edge.state().cause)
            assert edge.state().health == "degraded"
            taken.close()
            await requests.until(lambda: edge.metrics.port == port)
            await requests.until(lambda: "metrics: " not in edge.state().cause)
