"""The numbers in a robot's reports, by name, for plots; pure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

from fleet.errors import WireError
from fleet.wire.samples import json_payload
from fleet.wire.strict import parse_object
from fleet.wire.topics import parse_data_key

MOST = 200  # numbers of one report
MOST_IN_LIST = 12
DEEPEST = 4
LONGEST = 120  # characters of a name
WITHOUT = frozenset({"depth", "driverlog", "event", "frames", "map_update", "photo", "pointcloud", "streams"})
"""Channels with pictures, arrays or text."""
_NOT_PLOTTED = frozenset({"ts", "timestamp"})


def numbers_in(key: str, sample: bytes) -> dict[str, float]:
    """Return the numbers in a report on the bus by their path in it (``battery.percent``).

    Lists aligned with ``names``, as for joints, use these as the last part of the path. Empty for channels
    without numbers, and for invalid JSON.
    """
    data = parse_data_key(key)
    if data is None or data.channel in WITHOUT or data.channel.startswith("commands"):
        return {}
    try:
        message = parse_object(json_payload(sample))
    except WireError:
        return {}
    start = f"{data.channel}/{data.sensor}" if data.sensor else data.channel
    found = ((name, value) for name, value in _walk(start, message, 0) if len(name) <= LONGEST)
    return dict(itertools.islice(found, MOST))


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
