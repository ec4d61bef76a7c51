"""The bridge with the real cloud client, against the demo broker and Mosquitto."""

import json
import threading
from functools import partial

import paho.mqtt.publish
import pytest
from cyberwave.mqtt import CyberwaveMQTTClient

from fleet.bridge.bridge import Bridge, BridgeRules
from fleet.clock import SystemClock
from fleet.cloud.client import CloudClient
from fleet.cloud.values import CloudSettings, CloudState
from fleet.model.command import Reply, ReplyStatus
from fleet.model.report import TelemetryReport
from fleet.model.state import EdgeState, RobotState
from fleet.wire.databus import encode_report
from fleet.wire.rulebook import rulebook, twin_rules
from fleet.wire.rules import INWARD, NOT_OF_A_TWIN, TrafficClass
from tests.tools.sdk import end
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
T = f"cyberwave/twin/{TWIN}/"


def settings(port, name="", **more):
    return CloudSettings(host="127.0.0.1", port=port, tls=False, client_id=name, **more)


class Listener:
    """A client that hears all there is, and can speak."""

    def __init__(self, loop, port):
        self.heard, self.port = [], port
        self.client = CloudClient(
            settings(port, "listener"),
            {"cyberwave/#": 1},
            on_message=self._take,
            on_read=lambda: None,
            on_state=lambda *_: None,
            clock=SystemClock(),
        )
        loop.call(self.client.start)
        wait_until("the listener is in", lambda: self.client.state is CloudState.CONNECTED)

    def _take(self, messages):
        self.heard += [(message.topic, json.loads(message.payload)) for message in messages]

    def telemetry(self, twin=TWIN):
        topic = f"cyberwave/twin/{twin}/telemetry"
        return [message["type"] for heard, message in list(self.heard) if heard == topic]


@pytest.fixture(params=["broker", "mosquitto"])
def port(request):
    """Serve the test once with each broker."""
    return request.getfixturevalue(request.param).port


@pytest.fixture
def listener(background_loop, port):
    listener = Listener(background_loop, port)
    yield listener
    listener.client.close()


@pytest.fixture
def make_bridge(background_loop, topics, ports):
    """Build bridges, and close what is still open."""
    made = []

    def make_bridge(port, edge="yard-1", *, rules=None, clock=None, **connection):
        claims, put = [], []
        bridge = Bridge(
            settings(port, **connection),
            topics,
            ports,
            edge=edge,
            rules=rules or BridgeRules(dict.fromkeys(ports, twin_rules(rulebook()))),
            put=lambda key, _sample: put.append(key),
            alive=lambda _name: True,
            claimed=lambda twin, holder: claims.append((twin, holder)),
            clock=clock or SystemClock(),
        )
        bridge.claims, bridge.put = claims, put
        made.append(bridge)
        background_loop.call(bridge.start)
        wait_until("the bridge is in", lambda: bridge.client.state is CloudState.CONNECTED)
        return bridge

    yield make_bridge
    for bridge in made:
        bridge.client.close()


@pytest.fixture
def bridge(make_bridge, port):
    return make_bridge(port)


def test_reports_cross_with_the_next_turn(bridge, listener, pose):
    bridge.uplink.arrived(f"cw/{TWIN}/data/position", pose(4.0))
    list(bridge.tick())
    position = wait_until("the pose is heard", lambda: dict(listener.heard).get(f"{T}position"))
    assert position["position"]["x"] == 4.0
    assert position["session_id"].startswith("fleet_live_")


THIRD = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c13"


def test_a_twin_that_joins_is_heard_and_one_that_leaves_is_not(
    make_bridge, listener, background_loop, rex, pose
):
    port = listener.port
    bridge = make_bridge(port)
    bridge.uplink.arrived(f"cw/{THIRD}/data/position", pose(1.0))  # a stranger's, until now
    ada = type(rex)("ada", THIRD)
    background_loop.call(bridge.join, ada, twin_rules(rulebook()))
    bridge.uplink.arrived(f"cw/{THIRD}/data/position", pose(5.0))
    list(bridge.tick())
    topic = f"cyberwave/twin/{THIRD}/"
    wait_until("its pose is heard", lambda: f"{topic}position" in dict(listener.heard))
    stop = json.dumps({"command": "emergency_stop"})

    def command_arrived():
        paho.mqtt.publish.single(f"{topic}command", stop, 1, hostname="127.0.0.1", port=port)
        return ada.emergencies

    wait_until("its command arrives", command_arrived)
    background_loop.call(bridge.leave, THIRD)
    wait_until("it is disconnected", lambda: listener.telemetry(THIRD)[-1:] == ["disconnected"])
    number = len(ada.emergencies)
    for to in (topic, T):
        paho.mqtt.publish.single(f"{to}command", stop, 1, hostname="127.0.0.1", port=port)
    wait_until("the others go on", lambda: rex.emergencies)
    assert len(ada.emergencies) == number
    bridge.uplink.arrived(f"cw/{THIRD}/data/position", pose(6.0))
    assert list(bridge.tick()) == []
    assert bridge.client.stats.connects == 1


def test_another_robot_of_a_twin_takes_its_place(bridge, background_loop, port, rex):
    ada = type(rex)("ada", TWIN)
    background_loop.call(bridge.join, ada, twin_rules(rulebook()))
    stop = json.dumps({"command": "emergency_stop"})
    paho.mqtt.publish.single(f"{T}command", stop, 1, hostname="127.0.0.1", port=port)
    wait_until("it is told", lambda: ada.emergencies)
    assert rex.emergencies == []
    assert bridge.downlink.latencies.keys() == {"ada", "kestrel"}


def test_an_event_on_the_bus_crosses_without_a_turn_and_many_are_written_together(
    bridge, listener, monkeypatch
):
    report = TelemetryReport(1.0, "authority_lost")
    wake, woken = bridge.client._schedule, []
    monkeypatch.setattr(bridge.client, "_schedule", lambda call: woken.append(call) or wake(call))
    bridge.handle_samples(
        [(f"cw/{TWIN}/data/telemetry", encode_report(report, number)) for number in range(50)]
    )
    wait_until("all are heard", lambda: listener.telemetry(TWIN).count("authority_lost") == 50)
    assert sum(isinstance(call, partial) for call in woken) == 1  # others: the spool's


def test_a_turn_without_anything_to_say_wakes_nobody(bridge, monkeypatch):
    monkeypatch.setattr(bridge.client, "_schedule", lambda _: pytest.fail("woke the loop"))
    list(bridge.tick())


def test_an_emergency_stop_is_made_while_the_loop_is_stuck(bridge, background_loop, port, rex):
    stopped = threading.Event()
    blocked = threading.Thread(target=background_loop.call, args=(stopped.wait, 20))
    blocked.start()
    stop = json.dumps({"command": "emergency_stop"})
    paho.mqtt.publish.single(f"{T}command", stop, 1, hostname="127.0.0.1", port=port)
    wait_until("the robot is stopped", lambda: rex.emergencies)
    assert blocked.is_alive()
    assert rex.received == []  # the orderly part is the loop's
    stopped.set()
    wait_until("the loop goes on with it", lambda: rex.received)


def test_a_twins_heartbeat_carries_how_its_robot_is_and_the_edge_has_one_of_its_own(
    bridge, background_loop, port
):
    heard = {}
    ear = CloudClient(
        settings(port, "ear"),
        {"cyberwave/#": 1, "edges/#": 1},
        on_message=lambda messages: heard.update((each.topic, json.loads(each.payload)) for each in messages),
        on_read=lambda: None,
        on_state=lambda *_: None,
        clock=SystemClock(),
    )
    background_loop.call(ear.start)
    wait_until("the ear is in", lambda: ear.state is CloudState.CONNECTED)
    rex = RobotState("rex", TWIN, "toy", "yard-1", 1.0, "offline", "nothing received for 3 s")
    kestrel = RobotState("kestrel", OTHER, "toy", "yard-1", 1.0, "ok")
    edge = EdgeState("yard-1", "0.1", 1.0, 9.0, "degraded", "rex offline", {"ok": 1, "offline": 1})
    bridge.beat({}, edge, [rex, kestrel])
    own = wait_until("the edge's own", lambda: heard.get("edges/yard-1/health"))
    ear.close()
    assert (own["health"], own["robots"]) == ("degraded", {"ok": 1, "offline": 1})
    heartbeats = [heard[f"cyberwave/twin/{twin}/edge_health"] for twin in (TWIN, OTHER)]
    assert [(each["health"], each["cause"]) for each in heartbeats] == [
        ("offline", "nothing received for 3 s"),
        ("ok", ""),
    ]


def test_every_twin_has_a_heartbeat(bridge, listener):
    bridge.beat({"cpu_temp_c": 41.5})
    wait_until("both and a ping are heard", lambda: len(listener.heard) == 3)
    beats = {topic: message for topic, message in listener.heard if "/ping/" not in topic}
    assert set(beats) == {f"{T}edge_health", f"cyberwave/twin/{OTHER}/edge_health"}
    beat = beats[f"{T}edge_health"]
    assert (beat["type"], beat["edge_id"], beat["streams"]) == ("edge_health", "yard-1", {})
    assert (beat["cpu_temp_c"], beat["source_type"], beat["twin_uuid"]) == (41.5, "edge", TWIN)
    assert beats[f"cyberwave/twin/{OTHER}/edge_health"]["source_type"] == "sim"


def test_whoever_ends_says_that_its_twins_are_disconnected_and_their_telemetry_is_over(bridge, listener):
    bridge.close()
    wait_until("both are heard", lambda: len(listener.heard) == 4)
    assert listener.telemetry() == listener.telemetry(OTHER) == ["disconnected", "telemetry_end"]
    assert {message.get("reason") for _, message in listener.heard} == {"the edge ends", None}


def test_the_end_of_an_edge_closes_no_stream_of_a_program_beside_it(bridge, listener):
    offer = {"type": "offer", "target": "backend", "sdp": "v=0", "ts": 5.0}
    bridge.uplink.arrived(f"cw/{TWIN}/data/webrtc_offer", json.dumps(offer).encode())
    bridge.close()
    wait_until("both are heard", lambda: "telemetry_end" in listener.telemetry(OTHER))
    assert listener.telemetry() == ["disconnected"]


def test_only_what_asks_something_of_our_twins_is_subscribed(broker, make_bridge, topics, ports):
    bridge = make_bridge(broker.port)
    (mine,) = broker.call(lambda: list(broker.broker._hub._directory.sessions.values()))
    rules = [rule for rule in INWARD.values() if rule.suffix not in NOT_OF_A_TWIN]
    wanted = {topics.twin(twin, rule.suffix): rule.qos for twin in ports for rule in rules}
    given = {pattern: one.options for pattern, one in mine.subscriptions.items()}
    assert {pattern: int(options.max_qos) for pattern, options in given.items()} == wanted
    assert all(options.no_local for options in given.values())
    assert bridge.client.cause == ""  # no subscription was refused


def test_a_request_of_the_sdk_gets_its_answer(bridge, port, rex):
    rex.answers = lambda *_: Reply("takeoff", ReplyStatus.DENIED, "no GPS", device_result="MAV_RESULT_DENIED")
    sdk = CyberwaveMQTTClient(
        mqtt_broker="127.0.0.1", mqtt_port=port, use_tls=False, api_key="x", topic_prefix=""
    )
    sdk.connect()
    try:
        answer = sdk.request_command(TWIN, "takeoff", {"altitude": 2.0}, timeout_s=30.0)
    finally:
        end(sdk)
    assert (answer["status"], answer["reason"], answer["device_result"]) == (
        "denied",
        "no GPS",
        "MAV_RESULT_DENIED",
    )
    ((kind, payload, request_id),) = rex.received
    assert (kind, json.loads(payload)["data"]) == ("command", {"altitude": 2.0})
    assert request_id


def test_a_legacy_status_does_not_come_back_as_a_command(bridge, listener, rex):
    rex.answers = lambda *_: Reply("land", ReplyStatus.ACCEPTED)
    listener.client.publish(
        f"{T}command", b'{"command": "land", "source_type": "tele"}', qos=1, traffic=TrafficClass.REPLY
    )
    wait_until("command and status are heard", lambda: len(listener.heard) >= 1)
    bridge.beat({})  # comes after the status on the same connection
    wait_until("the heartbeats are heard", lambda: [t for t, _ in listener.heard if "edge_health" in t])
    assert len(rex.received) == 1


def test_an_edge_that_vanishes_is_reported_by_its_will_and_taken_back_when_it_is_there(
    background_loop, broker, make_bridge
):
    listener = Listener(background_loop, broker.port)
    try:
        make_bridge(broker.port, keepalive=1)  # s: so soon it knows that the broker has forgotten it
        (us,) = [name for name in broker.call(lambda: broker.broker.clients) if name != "listener"]
        broker.call(broker.broker.half_open, us)
        wait_until("the will is heard", lambda: "disconnected" in listener.telemetry())
        wait_until("it is taken back", lambda: "connected" in listener.telemetry())
        assert listener.telemetry() == ["disconnected", "connected"]
        assert listener.telemetry(OTHER) == ["connected"]
    finally:
        listener.client.close()


def test_an_answer_does_not_wait_for_the_wheel(bridge, listener, rex):
    answered = threading.Event()
    rex.answers = lambda *_: answered.set() or Reply("land", ReplyStatus.REJECTED, "stale")
    listener.client.publish(f"{T}command", b'{"command": "land"}', qos=1, traffic=TrafficClass.REPLY)
    assert answered.wait(60)
    wait_until("the status is heard", lambda: [m for _, m in listener.heard if m.get("reason") == "stale"])


class Cloud(Listener):
    """A listener that answers pings as the cloud does."""

    def _take(self, messages):
        super()._take(messages)
        for message in messages:
            if "/ping/" in message.topic:
                topic = message.topic.replace("/ping/", "/pong/").replace("/request", "/response")
                self.client.publish(topic, b'{"type": "pong", "timestamp": 1.0}')


def test_the_round_trip_to_the_cloud_is_measured(background_loop, bridge, port):
    cloud = Cloud(background_loop, port)
    try:
        bridge.beat({})
        wait_until("the pong is there", lambda: bridge.round_trip.seconds is not None)
        assert 0 < bridge.round_trip.seconds < 60
    finally:
        cloud.client.close()


def test_whoever_pings_one_of_our_twins_is_answered_by_name(bridge, listener):
    listener.client.publish(f"cyberwave/ping/{TWIN}/request", b'{"type": "ping"}')
    pong = f"cyberwave/pong/{TWIN}/response"
    message = wait_until("the pong is heard", lambda: dict(listener.heard).get(pong))
    assert (message["type"], message["edge_id"]) == ("pong", "yard-1")
    assert bridge.round_trip.seconds is None


def heartbeat(edge, uptime, session="them"):
    message = {"type": "edge_health", "edge_id": edge, "uptime_seconds": uptime, "session_id": session}
    return json.dumps(message).encode()


def test_a_twin_of_an_edge_that_was_there_before_is_left_to_it(bridge, listener):
    for _ in range(2):
        listener.client.publish(
            f"{T}edge_health", heartbeat("yard-0", 5000.0), qos=1, traffic=TrafficClass.REPLY
        )
    wait_until("the claim is noted", lambda: bridge.claims)
    assert bridge.claims == [(TWIN, "yard-0")]
    bridge.set_holder(TWIN, "yard-0")
    bridge.beat({})
    other = f"cyberwave/twin/{OTHER}/edge_health"
    wait_until("the other twin's is heard", lambda: other in dict(listener.heard))
    ours = [m for topic, m in listener.heard if topic == f"{T}edge_health" and m["edge_id"] == "yard-1"]
    assert ours == []


def test_of_two_bridges_for_one_twin_only_the_later_gives_way(broker, make_bridge):
    first = make_bridge(broker.port)
    first._conflicts._began -= 60.0
    first.publisher._began -= 60.0
    second = make_bridge(broker.port, edge="yard-2")
    for _ in range(2):
        first.beat({})
        second.beat({})
    wait_until("the later hears of the first", lambda: len(second.claims) == 2)
    assert {edge for _, edge in second.claims} == {"yard-1"}
    assert first.claims == []


def test_an_offer_reaches_the_local_program_and_its_answer_the_cloud(bridge, listener):
    offer = json.dumps({"type": "offer", "target": "edge", "sdp": "v=0"}).encode()
    listener.client.publish(f"{T}webrtc-offer", offer, qos=1, traffic=TrafficClass.REPLY)
    wait_until("it is on the bus", lambda: bridge.put == [f"cw/{TWIN}/data/cloud/webrtc_offer"])
    answer = {"type": "answer", "target": "backend", "sdp": "v=0", "ts": 5.0, "session_id": "c_front"}
    bridge.uplink.arrived(f"cw/{TWIN}/data/webrtc_answer", json.dumps(answer).encode())
    own = {**answer, "type": "offer", "sdp": "v=1"}
    bridge.uplink.arrived(f"cw/{TWIN}/data/webrtc_offer", json.dumps(own).encode())
    list(bridge.tick())
    heard = wait_until("it is heard", lambda: dict(listener.heard).get(f"{T}webrtc-answer"))
    offers = f"{T}webrtc-offer"
    wait_until("ours is heard", lambda: [m for t, m in listener.heard if t == offers and m["sdp"] == "v=1"])
    wait_until("both are completed", lambda: bridge.client.stats.acked == 2)
    assert (heard["session_id"], heard["timestamp"]) == ("c_front", 5.0)
    assert "source_type" not in heard
