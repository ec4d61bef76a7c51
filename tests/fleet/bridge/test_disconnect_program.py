"""What is told of a dead edge, on the demo broker and on Mosquitto."""

import asyncio
import io
import json
import subprocess
import sys

import msgspec
import pytest

from fleet.bridge import disconnect_program
from fleet.bridge.disconnect_program import DisconnectPlan, publish_disconnected
from fleet.clock import SystemClock
from fleet.cloud.values import CloudSettings, Will
from tests.tools.mqtt import Mqtt
from tests.tools.waiting import wait_until


@pytest.fixture(params=["broker", "mosquitto"])
def port(request):
    return request.getfixturevalue(request.param).port


def words(port, topics=("cyberwave/twin/a/telemetry", "cyberwave/twin/b/telemetry")):
    will = Will("cyberwave/twin/a/telemetry", b"{}")
    settings = CloudSettings(host="127.0.0.1", port=port, tls=False, client_id="edge", will=will)
    return DisconnectPlan(settings, "fleet_live_1", topics)


def test_every_twin_is_published_as_disconnected_by_a_program_of_its_own(port):
    heard = {}
    took = lambda packet, _now: heard.__setitem__(packet.topic, packet.payload)  # noqa: E731
    left = msgspec.json.encode(words(port, tuple(f"cyberwave/twin/{n}/telemetry" for n in range(200))))
    program = [sys.executable, "-m", "fleet.bridge.disconnect_program"]
    with Mqtt(port, "ear", topics=["cyberwave/#"], took=took):
        assert subprocess.run(program, input=left, check=False, timeout=60).returncode == 0
        wait_until("all are heard", lambda: len(heard) == 200)
    messages = [json.loads(payload) for payload in heard.values()]
    assert {(each["type"], each["reason"], each["session_id"]) for each in messages} == {
        ("disconnected", "the edge died", "fleet_live_1")
    }
    assert "source_type" not in messages[0]


def test_a_broker_that_is_away_is_given_up_in_time(free_port, monkeypatch):
    monkeypatch.setattr(disconnect_program, "WITHIN", 0.3)
    assert asyncio.run(publish_disconnected(words(free_port), SystemClock())) is False


def test_what_cannot_be_read_is_reported_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"nonsense")))
    assert disconnect_program.main() == 1
    assert (
        "fleet: cannot report the death of the edge to the cloud: JSON is malformed"
        in capsys.readouterr().err
    )
