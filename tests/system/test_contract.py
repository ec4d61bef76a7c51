"""Cyberwave's contract seen from outside: the published SDK in the cloud and on the bus, an edge between.

docs/reference/contract.md says for each part of the contract whether it is kept, and by which test.
"""

import base64
import functools
import json
import time

import numpy as np
import pytest
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend
from cyberwave.mqtt import CyberwaveMQTTClient
from cyberwave_contracts import MODELS_BY_CONTRACT_ID

from tests.system.conftest import subscribers
from tests.tools.command_client import PUPPETS
from tests.tools.sdk import end
from tests.tools.waiting import wait_until

TWIN, OTHER = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7ba1", "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7ba2"
PLACE = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7bb0"
CONTRACTS = {
    "battery/status": "twin.battery.v1",
    "flight_state": "twin.flight_state.v1",
    "flight_controller": "twin.flight_controller.v1",
}
UNTAGGED = ("/telemetry", "/webrtc-offer", "/webrtc-answer", "/webrtc-candidate")  # as the SDK sends them
OWN = ("edges/", "cyberwave/ping/", "cyberwave/pong/")


class Outside:
    """The cloud's side and the bus's side of one twin, both by the published SDK."""

    def __init__(self, edge, subscriber, broker, folder):
        self.edge = edge
        self.subscriber = subscriber  # from before the edge's start
        self.cloud = subscriber.pilot(TWIN)
        self.sdk = CyberwaveMQTTClient("127.0.0.1", broker.port, api_key="cw_test", source_type="tele")
        self.sdk.connect()
        self.backend = get_backend()
        self.bus = DataBus(self.backend, twin_uuid=TWIN)
        self.journal = folder / "journal"

    def done(self):
        """Return what the robot was made to do, by name."""
        lines = self.journal.read_text().splitlines() if self.journal.exists() else []
        return [json.loads(line)["what"] for line in lines]

    def puts(self, channel, message):
        """Publish on the bus as a local program."""
        self.bus.publish(channel, message)

    def close(self):
        end(self.sdk)
        self.backend.close()


@pytest.fixture(scope="module")
def outside(shared_fleet, shared_foreign_broker, shared_folder):
    """Run an edge with one robot that does what it is told, and stand on both sides of it."""
    robot = {"name": "rex", "twin": TWIN, "adapter": "puppet", "worker": "main", "rate": 20}
    config = {
        "edge": {"id": "yard"},
        "plugins": [str(PUPPETS)],
        "cloud": {
            "host": "127.0.0.1",
            "port": shared_foreign_broker.port,
            "tls": False,
            "environments": [PLACE],
            "rules": {"depth": {"layout": "string"}},
        },
        "robots": [{**robot, "journal": str(shared_folder / "journal")}],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(config))
    with subscribers() as subscriber, pytest.MonkeyPatch.context() as patch:
        listener = subscriber("127.0.0.1", shared_foreign_broker.port, "#")
        running = shared_fleet("run", "--json", folder=shared_folder)
        running.robot("rex", "is well", lambda state: state["health"] == "ok")
        runtime = running.environment["FLEET_RUNTIME_DIR"]
        patch.setenv("ZENOH_CONNECT", f"unixsock-stream/{runtime}/yard.reports.sock")
        patch.setenv("ZENOH_MODE", "client")
        outside = Outside(running, listener, shared_foreign_broker, shared_folder)
        outside.cloud.wait_for("position", "the bridge is in", bool)
        yield outside
        outside.close()


def test_the_sdk_asks_a_robot_with_one_answer_and_every_message_keeps_the_contract(outside):
    outside.sdk.ping(TWIN)
    wait_until(
        "the pong",
        lambda: [
            at for at, _ in list(outside.subscriber.received) if at.endswith("pong/" + TWIN + "/response")
        ],
    )
    answer = outside.sdk.request_command(TWIN, "poke", {"number": 1}, source_type="tele", timeout_s=30.0)
    MODELS_BY_CONTRACT_ID["twin.command_response.v1"].model_validate(answer)
    assert (answer["status"], answer["command"], answer["twin_uuid"]) == ("accepted", "poke", TWIN)
    wait_until("it was done", lambda: outside.done().count("poke") == 1)
    answer = outside.sdk.request_command(TWIN, "poke", {"number": 2}, source_type="edit", timeout_s=30.0)
    assert (answer["status"], "tele" in answer["reason"]) == ("rejected", True)
    assert outside.done().count("poke") == 1
    for leaf in ("position", "rotation", "joint:update", "telemetry", "edge_health"):
        outside.cloud.wait_for(leaf, "it is sent", bool)
    types = [each["type"] for each in outside.cloud.of("telemetry")]
    assert types[:2] == ["connected", "telemetry_start"]
    received = [each for each in outside.subscriber.received if not each[0].startswith(OWN)]
    assert received
    for topic, message in received:
        if topic.endswith("/command") and "status" not in message:
            continue  # ours
        if not topic.endswith(UNTAGGED):
            MODELS_BY_CONTRACT_ID["source_type.envelope.v1"].model_validate(message)
        contract = CONTRACTS.get(topic.partition(f"{TWIN}/")[2])
        if contract:
            MODELS_BY_CONTRACT_ID[contract].model_validate(message)
    session = outside.cloud.of("position")[-1]["session_id"]
    assert session.startswith("fleet_live_")
    ours = [message for _, message in received if message.get("session_id") == session]
    assert {message["source_type"] for message in ours if "source_type" in message} == {"edge"}


def test_what_is_for_somebody_else_or_is_no_request_moves_nothing_and_is_reported(outside):
    wrong = [
        {"twin_uuid": OTHER},
        {"source_type": "preview"},
        {"source_type": "edge_leader"},
        {"timestamp": time.time() - 3600},
        {"data": {"number": "1"}},
    ]
    done = outside.done().count("poke")
    for more in wrong:
        before = len(outside.cloud.answers("poke"))
        outside.cloud.publish("command", command="poke", **{"data": {"number": 1}, **more})
        answer = wait_until(f"{more} is answered", lambda seen=before: outside.cloud.answers("poke")[seen:])[
            0
        ]
        assert answer["status"] == "error", more
    goal = '{"command": "goto", "action_id": "a1", "source_type": "tele", "position": [NaN, 0, 0]}'
    outside.subscriber.client.publish(outside.cloud.topic("navigate/command"), goal, qos=1)
    failed = outside.cloud.wait_for(
        "navigate/status", "the goal failed", lambda each: each["action_id"] == "a1"
    )
    assert failed["status"] == "failed"
    assert outside.done().count("poke") == done
    session = outside.cloud.of("position")[-1]["session_id"]
    outside.cloud.publish("command", command="emergency_stop", data={"copy": {"session_id": session}})
    outside.edge.robot("rex", "is stopped", lambda state: state.get("emergency_stop"))
    assert outside.cloud.command("release_emergency_stop")["status"] == "ok"


def test_what_programs_on_the_bus_say_in_the_published_forms_reaches_the_cloud_whole(outside):
    now = time.time()
    said = {
        "metrics": {"metrics": {"load": {"loaded": True, "weight_kg": 2.5}}, "timestamp": now},
        "driverlog": {
            "type": "driver_log",
            "message": "lidar started",
            "level": "info",
            "container_name": "lidar-1",
            "sdk_version": "0.7.4",
            "timestamp": now,
        },
        "telemetry": {"type": "camera_stored", "recording_id": "r-7", "timestamp": now},
        "event": {"event_type": "person_seen", "source": "worker", "data": {"count": 2}, "timestamp": now},
        "webrtc_candidate": {"candidate": "candidate:1 1 udp 1 10.0.0.1 5000 typ host", "sdpMLineIndex": 0},
    }

    def crossed(leaf, holds):
        return [each for each in outside.cloud.of(leaf) if holds(each)]

    def all_crossed():
        for channel, message in said.items():
            outside.puts(channel, message)
        outside.puts("depth", np.full((2, 3), 700, np.uint16))
        return (
            crossed("metrics", lambda it: it["metrics"].get("load") == {"loaded": True, "weight_kg": 2.5})
            and crossed(
                "driverlog", lambda it: it.get("container_name") == "lidar-1" and it["level"] == "INFO"
            )
            and crossed("telemetry", lambda it: it.get("recording_id") == "r-7")
            and crossed("event", lambda it: it["event_type"] == "person_seen" and it["data"] == {"count": 2})
            and crossed("webrtc-candidate", lambda it: it["candidate"].startswith("candidate:1"))
            and crossed("depth", lambda it: base64.b64decode(it["data"]) == np.full(6, 700, "<u2").tobytes())
        )

    wait_until("all of it crossed", all_crossed)


def test_what_the_cloud_says_to_programs_reaches_them_on_the_bus(outside):
    received = {}
    said = {
        "webrtc-candidate": {"candidate": "candidate:2 1 udp 1 10.0.0.2 5000 typ host", "sdpMid": "0"},
        "alert": {"name": "low battery", "severity": "warning", "state": "active"},
        "position": {"source_type": "edit", "position": {"x": 1.0, "y": 2.0, "z": 0.0}},
        "scale": {"source_type": "edit", "scale": {"x": 1.0, "y": 1.0, "z": 2.0}},
    }
    channels = {"webrtc-candidate": "cloud/webrtc_candidate", "alert": "alert"}
    for leaf in said:
        channel = channels.get(leaf, f"cloud/{leaf}")
        outside.bus.subscribe(channel, lambda message, leaf=leaf: received.update({leaf: message}))
    removed, topic = "cloud/twin_removed", f"cyberwave/environment/{PLACE}/twin_removed"
    outside.bus.subscribe(removed, lambda message: received.update({removed: message}), twin_uuid=PLACE)

    def all_heard():
        for leaf, message in said.items():
            outside.cloud.publish(leaf, **message)
        outside.subscriber.publish(topic, {"twin_uuid": OTHER, "timestamp": 1.0})
        return received.keys() >= said.keys() | {removed}

    wait_until("all of it crossed", all_heard)
    assert {leaf: received[leaf] | message for leaf, message in said.items()} == {
        leaf: received[leaf] for leaf in said
    }
    assert received[removed]["twin_uuid"] == OTHER


def test_an_edge_is_configured_by_the_environment_of_the_sdk_and_keeps_to_its_prefix(
    fleet, subscriber, foreign_broker, tmp_path, monkeypatch
):
    monkeypatch.setenv("CYBERWAVE_MQTT_HOST", "127.0.0.1")
    monkeypatch.setenv("CYBERWAVE_MQTT_PORT", str(foreign_broker.port))
    monkeypatch.setenv("CYBERWAVE_MQTT_USE_TLS", "false")
    monkeypatch.setenv("CYBERWAVE_API_KEY", "cw_x")
    monkeypatch.setenv("CYBERWAVE_TOPIC_PREFIX", "local")
    robot = {"name": "rex", "twin": TWIN, "adapter": "puppet", "worker": "main", "rate": 20}
    config = {"edge": {"id": "prefixed"}, "plugins": [str(PUPPETS)], "cloud": {}, "robots": [robot]}
    (tmp_path / "fleet.yaml").write_text(json.dumps(config))
    listener = subscriber("127.0.0.1", foreign_broker.port, "#")
    running = fleet("run", "--json", folder=tmp_path)
    running.robot("rex", "is well", lambda state: state["health"] == "ok")
    prefix = f"localcyberwave/twin/{TWIN}/"
    session = wait_until("it is heard", lambda: dict(listener.received).get(f"{prefix}position"))[
        "session_id"
    ]
    message = {"source_type": "tele", "command": "poke", "data": {"number": 1}}
    listener.publish(f"cyberwave/twin/{TWIN}/command", {**message, "timestamp": time.time()})
    sdk = CyberwaveMQTTClient("127.0.0.1", foreign_broker.port, api_key="cw_x", topic_prefix="local")
    sdk.connect()
    request = functools.partial(sdk.request_command, TWIN, "poke", source_type="tele", timeout_s=30.0)
    answer = request({"number": 2})
    assert answer["status"] == "accepted", answer.get("reason", answer)
    end(sdk)
    topics = {at for at, message in listener.received if message.get("session_id") == session}
    assert {at for at in topics if not at.startswith(("localcyberwave/", "localedges/"))} == set()
    unprefixed = [message for at, message in listener.received if at == f"cyberwave/twin/{TWIN}/command"]
    assert [message for message in unprefixed if "status" in message] == []
