"""Events of a simulated PX4, and the metadata file with their texts."""

from __future__ import annotations

import json
import lzma
import struct
from collections.abc import Mapping
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

PATH = "etc/extras/all_events.json.xz"
ACTIONS: Mapping[str, int] = {"LOITER": 5, "RTL": 6, "LAND": 7, "DESCEND": 8, "POSCTL": 2}
CAUSES: Mapping[str, int] = {"radio": 1, "gcs": 2, "critical": 4, "emergency": 5}
DISENGAGED, HOLDS, ENTERS, GENERIC = 12770418, 13704694, 9751178, 14605264
_ACTION, _CAUSE = "px4::failsafe_action_t", "px4::failsafe_cause_t"


def _event(name: str, message: str, *types: str) -> dict[str, object]:
    return {"name": name, "message": message, "arguments": [{"name": "", "type": each} for each in types]}


def _enum(*words: str) -> dict[str, object]:
    entries = {str(value): {"name": "", "description": word} for value, word in enumerate(words)}
    return {"type": "uint8_t", "entries": entries}


_LIST = {
    "version": 2,
    "components": {
        "1": {
            "namespace": "px4",
            "enums": {
                "failsafe_action_t": _enum(
                    "", "warning", "Position mode", "", "", "Hold", "RTL", "Land", "Descend"
                ),
                "failsafe_cause_t": _enum(
                    "",
                    "Manual control loss",
                    "GCS connection loss",
                    "",
                    "Critical battery level",
                    "Emergency battery level",
                ),
            },
            "event_groups": {
                "default": {
                    "events": {
                        str(DISENGAGED): _event(
                            "disengaged",
                            "Failsafe activated: Autopilot disengaged, switching to {2}",
                            "uint32_t",
                            _ACTION,
                        ),
                        str(HOLDS): _event(
                            "holds",
                            "{4}: switching to {2} in {3} seconds",
                            "uint32_t",
                            _ACTION,
                            "uint16_t",
                            _CAUSE,
                        ),
                        str(ENTERS): _event("enters", "{3}: switching to {2}", "uint32_t", _ACTION, _CAUSE),
                        str(GENERIC): _event(
                            "generic", "Failsafe activated: switching to {2}", "uint32_t", _ACTION
                        ),
                    }
                }
            },
        }
    },
}
PACKED = lzma.compress(json.dumps(_LIST).encode())


class EventMessage(mav.MAVLink_message):  # type: ignore[misc]  # pymavlink has none
    """EVENT, which pymavlink lacks."""

    id = 410
    msgname = "EVENT"
    crc_extra = 160
    fieldnames: ClassVar[list[str]] = []

    def __init__(self, number: int, packing: str, *arguments: int) -> None:
        super().__init__(self.id, self.msgname)
        self.sequence = 0
        self._number = 1 << 24 | number
        self._arguments = struct.pack(packing, *arguments).ljust(40, b"\0")

    def pack(self, link: object, force_mavlink1: bool = False) -> bytes:  # noqa: FBT001, FBT002 - signature of pymavlink
        """Return the frame, log level 2."""
        payload = struct.pack("<IIHBBB", self._number, 0, self.sequence, 0, 0, 0x42) + self._arguments
        return bytes(self._pack(link, self.crc_extra, payload, force_mavlink1=force_mavlink1))


def failsafe_event(action: str, why: str, *, seconds: int | None = None) -> EventMessage:
    """Return the event of a fail-safe: its action, its cause, and the delay in seconds."""
    number, cause = ACTIONS[action], CAUSES.get(why)
    if why == "position":
        return EventMessage(DISENGAGED, "<IB", 0, ACTIONS["DESCEND"])
    if cause is None:
        return EventMessage(GENERIC, "<IB", 0, number)
    if seconds is not None:
        return EventMessage(HOLDS, "<IBHB", 0, number, seconds, cause)
    return EventMessage(ENTERS, "<IBB", 0, number, cause)
