"""Decoder of PX4's EVENT messages, with the metadata file served by the vehicle itself. No I/O."""

from __future__ import annotations

import json
import lzma
import re
import struct
from collections.abc import Mapping
from typing import Any

import msgspec

from fleet_mavlink.event_messages import Event

PATH = "etc/extras/all_events.json.xz"
_MOST_BYTES = 8 << 20  # unpacked
_PROTOCOL = 8  # log level; events from here on are for programs
_FOR_PEOPLE = "default"  # group of plain events; the others are check results per mode
_BASE = {
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
}
_PLACE = re.compile(r"\{(\d+)(?::\.(\d+))?([a-zA-Z/%_^0-9]*)\}")
_UNITS = {"m_v": "m"}  # vertical metres
_TAG = re.compile(r"<[^>]*>")


class _EventType(msgspec.Struct, frozen=True):
    """One kind of event: its text, and the types of its arguments."""

    message: str
    arguments: tuple[str, ...]
    group: str


class _Enum(msgspec.Struct, frozen=True):
    """An enumeration: its base type, and the names of its values."""

    base: str
    words: Mapping[int, str]


class EventText(msgspec.Struct, frozen=True):
    """An event as text, with its severity 0 to 7."""

    text: str
    severity: int


class EventDictionary:
    """Event definitions of one firmware. Raises ValueError for an invalid file."""

    def __init__(self, packed: bytes) -> None:
        self._kinds: dict[int, _EventType] = {}
        self._enums: dict[str, _Enum] = {}
        try:
            unpacked = lzma.LZMADecompressor().decompress(packed, _MOST_BYTES)
            components = json.loads(unpacked)["components"]
            for number, component in components.items():
                self._read(int(number), component)
        except (lzma.LZMAError, KeyError, TypeError, AttributeError, ValueError) as error:
            raise ValueError(f"this is no list of events: {error}") from None

    def _read(self, component: int, metadata: Mapping[str, Any]) -> None:
        """Add the events and enumerations of one component."""
        space = metadata.get("namespace", "")
        for name, enum in metadata.get("enums", {}).items():
            words = {int(value): entry.get("description", "") for value, entry in enum["entries"].items()}
            one = _Enum(enum["type"], words)
            self._enums[name] = self._enums[f"{space}::{name}"] = one
        for group, events in metadata.get("event_groups", {}).items():
            for number, event in events["events"].items():
                types = tuple(each["type"] for each in event.get("arguments", ()))
                self._kinds[component << 24 | int(number)] = _EventType(event["message"], types, group)

    def __len__(self) -> int:
        return len(self._kinds)

    def say(self, event: Event) -> EventText | None:
        """Return an event as text; None for an unknown event, or one that is not for people."""
        kind, level = self._kinds.get(event.id), event.log_levels & 0x0F
        if kind is None or level >= _PROTOCOL or kind.group != _FOR_PEOPLE:
            return None
        try:
            values = self._values(kind.arguments, bytes(event.arguments))
        except (struct.error, KeyError):
            return None
        return EventText(_TAG.sub("", _PLACE.sub(lambda place: _put(place, values), kind.message)), level)

    def _values(self, types: tuple[str, ...], data: bytes) -> list[object]:
        """Unpack arguments: little-endian, without padding; enumeration values as their names."""
        values: list[object] = []
        at = 0
        for name in types:
            enum = self._enums.get(name)
            packing = struct.Struct("<" + _BASE[enum.base if enum else name])
            (value,) = packing.unpack_from(data, at)
            at += packing.size
            values.append(enum.words.get(value) or f"{value}" if enum else value)
        return values


def _put(place: re.Match[str], values: list[object]) -> str:
    """Return the text for one placeholder of a message: a value, its decimals, its unit."""
    index = int(place[1]) - 1
    if index >= len(values):
        return "?"
    value = values[index]
    if isinstance(value, float):
        value = f"{value:.{int(place[2] or 1)}f}"
    unit = _UNITS.get(place[3], place[3])
    return f"{value} {unit}" if unit else f"{value}"
