"""Heartbeats: ``T edge_health``, which shows the cloud that an edge serves a twin, and the edge's own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from fleet.model.state import EdgeState, RobotState
from fleet.wire.encoding import encode_finite

MOST_UNWELL = 50
"""Maximum number of unhealthy robots that an edge's summary names."""
_ROLLED_UP = (
    "version",
    "bus",
    "queued",
    "spooled",
    "refused",
    "dropped",
    "round_trip",
    "load",
    "memory_percent",
    "threads",
)


def edge_health(
    *,
    twin: str,
    edge_id: str,
    uptime: float,
    stamp: float,
    source_type: str,
    session: str,
    extra: Mapping[str, object],
    streams: Mapping[str, Mapping[str, object]] | None = None,
) -> bytes:
    """Return the heartbeat of one twin, with the fields and the order of the SDK.

    ``uptime`` in seconds, ``stamp`` Unix seconds, ``session`` omitted when empty. ``extra`` holds figures of
    the host (``host_memory_percent``, ``cpu_temp_c``, ...); it cannot replace the other fields, and unknown
    values in it (None, NaN) are omitted: a missing sensor must not cost the heartbeat. ``streams`` are those
    of programs on the bus, by id.
    """
    streams = streams or {}
    head: dict[str, Any] = {
        "type": "edge_health",
        "timestamp": stamp,
        "edge_id": edge_id,
        "uptime_seconds": round(uptime, 1),
        "streams": streams,
        "stream_count": len(streams),
        "healthy_streams": sum(stream["is_healthy"] for stream in streams.values()),
        "camera_config": None,
    }
    tail: dict[str, object] = {"source_type": source_type, "twin_uuid": twin}
    if session:
        tail["session_id"] = session
    figures = {name: value for name, value in extra.items() if _is_known(value)}
    for reserved in head.keys() | tail.keys() | {"session_id"}:
        figures.pop(reserved, None)
    return encode_finite({**head, **figures, **tail})


def edge_state(state: EdgeState, robots: Iterable[RobotState], *, session: str) -> bytes:
    """Return an edge's summary for ``edges/{edge}/health``: its health, its robots by health, and causes.

    ``robots``: all robots of the edge; the first ``MOST_UNWELL`` that are not ok are named. The other fields
    are those of ``fleet/{edge}/health`` on the bus.
    """
    fields = msgspec.to_builtins(state)
    figures = {name: fields[name] for name in _ROLLED_UP if _is_known(fields.get(name))}
    unwell = [
        {"name": robot.name, "twin_uuid": robot.twin, "health": robot.health, "cause": robot.cause}
        for robot in robots
        if robot.health != "ok"
    ]
    message: dict[str, object] = {
        "type": "edge_state",
        "timestamp": state.stamp,
        "edge_id": state.edge,
        "uptime_seconds": round(state.uptime, 1),
        "health": state.health,
        "cause": state.cause,
        "robots": state.robots,
        "unwell": unwell[:MOST_UNWELL],
        **figures,
    }
    if session:
        message["session_id"] = session
    return encode_finite(message)


def _is_known(value: object) -> bool:
    """Return False for None, NaN and infinity."""
    return value is not None and not (isinstance(value, float) and not math.isfinite(value))
