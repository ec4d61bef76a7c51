"""Program that reports all twins of a dead edge as disconnected; it runs for seconds at most.

An MQTT connection has one will, for one twin. The supervisor starts this program for all of them, with the
``DisconnectPlan`` of the edge on standard input: ``python -m fleet.bridge.disconnect_program``.
"""

from __future__ import annotations

import asyncio
import sys

import msgspec

from fleet.clock import Clock, SystemClock
from fleet.cloud.client import CloudClient
from fleet.cloud.credentials import client_id
from fleet.cloud.values import CloudSettings, CloudState
from fleet.errors import FleetError
from fleet.model.report import TelemetryReport
from fleet.runtime.decoding import decode_json
from fleet.wire.reports import sender, to_mqtt

WITHIN = 10.0  # s for the whole run
POLL_INTERVAL = 0.01  # s between two checks for missing acknowledgements
REASON = "the edge died"


class DisconnectPlan(msgspec.Struct, frozen=True):
    """How to reach the broker, the topics to publish on, and the edge's ``session`` for the payloads."""

    settings: CloudSettings
    session: str
    topics: tuple[str, ...]


async def publish_disconnected(plan: DisconnectPlan, clock: Clock) -> bool:
    """Publish ``disconnected`` on each topic; return whether the broker acknowledged all of it in time."""
    settings = msgspec.structs.replace(
        plan.settings, will=None, client_id=client_id("fleet-farewell", simulated=False)
    )
    client = CloudClient(
        settings,
        {},
        on_message=lambda _messages: None,
        on_read=lambda: False,
        on_state=lambda _state, _cause: None,
        clock=clock,
    )
    report = TelemetryReport(clock.time(), "disconnected", {"reason": REASON})
    ((_, payload),) = to_mqtt(report, sender(source_type="edge", session=plan.session))
    for topic in plan.topics:
        client.publish(topic, payload, qos=1, later=True)
    client.start()
    client.flush()
    end, topics = clock.monotonic() + WITHIN, len(plan.topics)
    while (open_ := _is_open(client, topics)) and clock.monotonic() < end:  # noqa: ASYNC110 - the client has counters, no event
        await asyncio.sleep(POLL_INTERVAL)
    await asyncio.to_thread(client.close)
    return not open_


def _is_open(client: CloudClient, topics: int) -> bool:
    """Return True while acknowledgements of the broker are missing and can still arrive."""
    return client.stats.acked + client.stats.refused < topics and client.state is not CloudState.REFUSED


def main() -> int:
    """Read the plan from standard input and carry it out; return 1 if the broker was not reached."""
    try:
        plan = decode_json(sys.stdin.buffer.read(), DisconnectPlan)
        return 0 if asyncio.run(publish_disconnected(plan, SystemClock())) else 1
    except (msgspec.DecodeError, FleetError) as error:
        sys.stderr.write(f"fleet: cannot report the death of the edge to the cloud: {error}\n")
        return 1


if __name__ == "__main__":
    sys.exit(main())
