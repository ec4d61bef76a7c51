"""The numbers in recorded messages, by the names that they have live; pure.

A recorded report is converted back to its form on the bus: so the names and units are those of
``fleet.console.numbers``, whatever the form in which it was recorded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from fleet.console.numbers import SPEED, numbers_in_state, numbers_of, source_of
from fleet.errors import WireError
from fleet.model.state import RobotState
from fleet.replay.reports import report_in
from fleet.runtime.decoding import decode_json
from fleet.wire.databus import encode_report
from fleet.wire.samples import json_payload

if TYPE_CHECKING:
    from fleet.record.reading import ReadMessage  # its packages are an extra

_STATE = "fleet.RobotState"
_SUFFIXES = {"fleet.Document": "document", "fleet.GpsReport": "no_fix"}
"""Last parts of topics that belong to the recording, not to the channel, by schema."""


def recorded_source(topic: str, schema: str) -> str:
    """Return the start of the names of a topic's numbers; empty for a topic without numbers."""
    if schema == _STATE:
        return SPEED
    parts = topic.split("/")[3:]  # after the edge and the robot
    suffix = _SUFFIXES.get(schema)
    if parts and parts[-1] == suffix:
        parts.pop()
    elif schema == "fleet.Document":
        return ""  # of an edge
    if not 1 <= len(parts) <= 2:
        return ""
    return source_of(parts[0], parts[1] if len(parts) == 2 else None)


def recorded_numbers(message: ReadMessage) -> dict[str, float]:
    """Return the numbers in a recorded message of a robot; raises ValueError for a damaged one."""
    source = recorded_source(message.topic, message.schema)
    if not source:
        return {}
    try:
        if message.schema == _STATE:
            return numbers_in_state(decode_json(message.data, RobotState))
        return numbers_of(source, _on_the_bus(message))
    except (msgspec.DecodeError, WireError) as error:
        raise ValueError(f"a recorded {message.schema} cannot be read: {error}") from None


def _on_the_bus(message: ReadMessage) -> dict[str, Any]:
    """Return a message in its form on the bus, empty if it is no report; raises as its decoders do."""
    if message.schema == "fleet.Document":
        return decode_json(message.data, dict[str, Any])
    report = report_in(message.schema, message.data)
    return decode_json(json_payload(encode_report(report, 0)), dict[str, Any]) if report is not None else {}
