"""The numbers in a robot's reports, by name, for plots; pure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

from fleet.errors import WireError
from fleet.model.state import RobotState
from fleet.wire.samples import json_payload
from fleet.wire.strict_json import parse_object
from fleet.wire.topics import parse_data_key

MOST = 200  # numbers of one report
MOST_IN_LIST = 12
DEEPEST = 4
LONGEST = 120  # characters of a name
WITHOUT = frozenset({"depth", "driverlog", "event", "frames", "map_update", "photo", "pointcloud", "streams"})
"""Channels with pictures, arrays or text."""
SPEED = "speed"
"""The number of a robot's state: m/s."""
_NOT_PLOTTED = frozenset({"ts", "timestamp"})


def numbers_in(key: str, sample: bytes) -> dict[str, float]:
    """Return the numbers in a report on the bus, as ``numbers_of`` names them.

    Empty for channels without numbers, and for invalid JSON.
    """
    data = parse_data_key(key)
    source = source_of(data.channel, data.sensor) if data is not None else ""
    if not source:
        return {}
    try:
        return numbers_of(source, parse_object(json_payload(sample)))
    except WireError:
        return {}


def source_of(channel: str, sensor: str | None) -> str:
    """Return the start of the names of a channel's numbers; empty for a channel without numbers."""
    if channel in WITHOUT or channel.startswith("commands"):
        return ""
    return f"{channel}/{sensor}" if sensor else channel


def source_in(name: str) -> str:
    """Return the source in the name of a number."""
    return name.partition(".")[0]


def numbers_of(source: str, message: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers in a message as it is on the bus, by their path in it (``battery.charge_pct``).

    Lists aligned with ``names``, as for joints, use these as the last part of the path.
    """
    found = ((name, value) for name, value in _walk(source, message, 0) if len(name) <= LONGEST)
    return dict(itertools.islice(found, MOST))


def numbers_in_state(state: RobotState) -> dict[str, float]:
    """Return the numbers of a robot's state."""
    return {SPEED: state.speed} if state.speed is not None else {}


def _walk(name: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a JSON value."""
    if isinstance(value, bool) or depth > DEEPEST:
        return
    if isinstance(value, int | float):
        if math.isfinite(value):
            yield name, value
    elif isinstance(value, dict):
        yield from _in_object(name, value, depth)
    elif isinstance(value, list) and len(value) <= MOST_IN_LIST:
        for number, each in enumerate(value):
            yield from _walk(f"{name}.{number}", each, depth + 1)


def _in_object(name: str, message: Mapping[str, Any], depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers in an object."""
    names = message.get("names")
    for field, each in message.items():
        if depth == 0 and field in _NOT_PLOTTED:
            continue
        if (
            isinstance(names, list)
            and isinstance(each, list)
            and len(each) == len(names)
            and each is not names
        ):
            for known, one in zip(names, each, strict=True):
                yield from _walk(f"{name}.{field}.{known}", one, depth + 1)
        else:
            yield from _walk(f"{name}.{field}", each, depth + 1)
