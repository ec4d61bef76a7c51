"""The published SDK's client talks through the demo broker."""

import json

import pytest
from cyberwave.mqtt import CommandResponseTimeoutError, CyberwaveMQTTClient
from cyberwave.mqtt.command_response import (
    CommandOutcome,
    publish_command_response,
)

from tests.tools.sdk import end

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def sdk(broker):
    """Connect the SDK's client, as an application does."""
    client = CyberwaveMQTTClient(
        "127.0.0.1", broker.port, api_key="cw_token", source_type="tele", announce_twin_sessions=False
    )
    client.connect()
    yield client
    end(client)


def test_a_command_gets_its_answer(sdk, broker, clients):
    driver = clients(broker.port, "driver", protocol=5).connect()
    driver.subscribe(f"cyberwave/twin/{TWIN}/command", 1)

    def answer(client, _data, message):
        name = json.loads(message.payload)["command"]
        publish_command_response(
            client,
            message,
            CommandOutcome.rejected("not now"),
            twin_uuid=TWIN,
            command=name,
            source_type="edge",
        )

    driver.paho.on_message = answer
    for _ in range(3):
        reply = sdk.request_command(TWIN, "takeoff", {"altitude": 2.0}, timeout_s=20.0)
        assert (reply["command"], reply["status"], reply["reason"]) == ("takeoff", "rejected", "not now")


def test_a_command_without_a_driver_times_out(sdk):
    with pytest.raises(CommandResponseTimeoutError):
        sdk.request_command(TWIN, "takeoff", timeout_s=0.2)
