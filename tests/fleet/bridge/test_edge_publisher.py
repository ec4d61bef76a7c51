"""What an edge says itself to the cloud, on which topic, and how it is counted and kept."""

import json
from types import SimpleNamespace

import pytest

from fleet.bridge.edge_publisher import EdgePublisher
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import EdgeState, RobotState
from fleet.spool.losses import Gap, Reason
from fleet.wire.rules import WORKFLOW_FINISHED, WORKFLOW_STARTED, TrafficClass

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
T = f"cyberwave/twin/{TWIN}"
REPLY, STATUS, EVENT, LATEST = (
    TrafficClass.REPLY,
    TrafficClass.STATUS,
    TrafficClass.EVENT,
    TrafficClass.LATEST,
)


@pytest.fixture
def edge(topics, clock):
    """Give an edge and what it publishes: topic, message and properties."""
    sent = []

    def publish(topic, payload, **properties):
        sent.append((topic, json.loads(payload), properties))
        return True

    publisher = EdgePublisher(topics, edge="yard-1", session="fleet_us", publish=publish, clock=clock)
    return SimpleNamespace(publisher=publisher, sent=sent, counts=publisher.published.by_class)


def test_telemetry_is_queued_as_an_event_with_session_and_source(edge, rex, clock):
    edge.publisher.queue_telemetry(rex, "connected", {"reason": "start"})
    ((topic, message, properties),) = edge.sent
    assert (topic, properties) == (f"{T}/telemetry", {"qos": 1, "later": True})
    assert (message["type"], message["reason"], message["timestamp"]) == ("connected", "start", clock.time())
    assert message["session_id"] == "fleet_us"
    assert (edge.counts()["event"], edge.publisher.published.total) == (1, 1)


def test_telemetry_can_be_made_without_being_sent(edge, rex):
    topic, payload = edge.publisher.telemetry(rex, "disconnected", {})
    assert (topic, json.loads(payload)["type"]) == (f"{T}/telemetry", "disconnected")
    assert (edge.sent, edge.publisher.published.total) == ([], 0)


def test_lost_messages_are_told_with_their_topic_reason_number_and_times(edge, rex):
    edge.publisher.queue_gap(rex, "navigate/status", Gap("any", Reason.ROOM, 7, 1.5, 2.5))
    ((topic, message, _),) = edge.sent
    assert (topic, message["type"]) == (f"{T}/telemetry", "gap")
    assert {name: message[name] for name in ("leaf", "reason", "lost", "since", "until")} == {
        "leaf": "navigate/status",
        "reason": "room",
        "lost": 7,
        "since": 1.5,
        "until": 2.5,
    }


def test_the_state_of_the_edge_goes_to_its_own_topic(edge):
    state = EdgeState("yard-1", "1.0", 5.0, 60.0, robots={"ok": 1, "lost": 1})
    robots = [
        RobotState("rex", TWIN, "a", "yard-1", 5.0, "lost", "no link"),
        RobotState("ok", TWIN, "a", "yard-1", 5.0, "ok"),
    ]
    edge.publisher.queue_edge_state(state, robots)
    ((topic, message, properties),) = edge.sent
    assert (topic, properties) == ("edges/yard-1/health", {"later": True})
    assert (message["edge_id"], message["session_id"], message["uptime_seconds"]) == (
        "yard-1",
        "fleet_us",
        60.0,
    )
    assert [(each["name"], each["cause"]) for each in message["unwell"]] == [("rex", "no link")]
    assert edge.counts()["latest"] == 1


def test_a_heartbeat_says_how_long_the_edge_runs_and_its_figures(edge, rex, clock):
    clock.advance(12.34)
    edge.publisher.queue_heartbeat(rex, {"cpu_temp_c": 50.0}, {"front": {"is_healthy": True}})
    ((topic, message, properties),) = edge.sent
    assert (topic, properties) == (f"{T}/edge_health", {"later": True})
    assert (message["uptime_seconds"], message["timestamp"]) == (12.3, clock.time())
    assert (message["edge_id"], message["twin_uuid"], message["session_id"]) == ("yard-1", TWIN, "fleet_us")
    assert (message["cpu_temp_c"], message["stream_count"], message["healthy_streams"]) == (50.0, 1, 1)
    assert (message["source_type"], edge.counts()["latest"]) == ("edge", 1)


def test_a_ping_and_its_answer_are_sent_at_once_because_time_is_measured(edge, rex, clock):
    edge.publisher.ping(TWIN)
    edge.publisher.pong(rex)
    (ping, asked, properties), (pong, answer, others) = edge.sent
    assert (ping, pong) == (f"cyberwave/ping/{TWIN}/request", f"cyberwave/pong/{TWIN}/response")
    assert (properties, others) == ({}, {})
    assert asked == {"type": "ping", "timestamp": clock.time(), "session_id": "fleet_us"}
    assert (answer["edge_id"], answer["source_type"], answer["timestamp"]) == ("yard-1", "edge", clock.time())
    assert edge.counts()["latest"] == 2


@pytest.mark.parametrize(
    ("suffix", "topic"),
    [
        (WORKFLOW_STARTED, f"cyberwave/workflow/{TWIN}/execution/started"),
        (WORKFLOW_FINISHED.replace("+", "e1"), f"cyberwave/workflow/{TWIN}/execution/e1/finished"),
        ("mission/status", f"{T}/mission/status"),
        ("unknown", f"{T}/unknown"),
    ],
)
def test_a_status_is_kept_until_it_is_acknowledged(edge, suffix, topic):
    edge.publisher.status(TWIN, suffix, b"{}")
    assert edge.sent == [(topic, {}, {"qos": 1, "expiry": None, "traffic": STATUS})]
    assert edge.counts()["status"] == 1


def test_a_status_expires_as_its_rule_says(edge):
    edge.publisher.status(TWIN, "webrtc-offer", b"{}")
    assert edge.sent[0][2]["expiry"] == 30


@pytest.mark.parametrize(
    ("topic", "expiry"),
    [
        (f"{T}/command/anna/response", 30),
        (f"{T}/command", 3600),
        (f"{T}/start_video/status", 30),
        (f"{T}/navigate/status", None),
        (f"{T}/unknown", None),
        ("elsewhere", None),
    ],
)
def test_a_reply_goes_before_everything_else_and_expires_as_the_rule_of_its_topic_says(edge, topic, expiry):
    edge.publisher.answer(topic, b"{}", correlation=b"q1")
    assert edge.sent == [
        (
            topic,
            {},
            {
                "qos": 1,
                "expiry": expiry,
                "correlation": b"q1",
                "content_type": "application/json",
                "traffic": REPLY,
            },
        )
    ]
    assert edge.counts()["reply"] == 1


def test_the_end_of_a_command_whose_process_is_gone_is_told_as_a_status(edge, rex, clock):
    edge.publisher.publish_end(rex, Reply("land", ReplyStatus.TIMEOUT, "its worker died", done=False))
    ((topic, message, properties),) = edge.sent
    assert (topic, properties["traffic"], properties["correlation"]) == (f"{T}/command", REPLY, None)
    assert (message["command"], message["ok"], message["done"]) == ("land", False, False)
    assert (message["reason"], message["timestamp"]) == ("its worker died", clock.time())


def test_a_robot_that_is_configured_not_to_sends_no_end(edge, rex):
    rex.legacy_status = False
    edge.publisher.publish_end(rex, Reply("land", ReplyStatus.ACCEPTED, done=True))
    assert (edge.sent, edge.publisher.published.total) == ([], 0)
