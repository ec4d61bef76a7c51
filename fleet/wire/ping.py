"""Ping and pong: round-trip time to the cloud, and presence of an edge.

The cloud answers ``ping/{uuid}/request`` on ``pong/{uuid}/response``. An edge answers for its twins too; its
pong carries its name, so that it is not mistaken for the cloud's.
"""

from __future__ import annotations

from fleet.errors import WireError
from fleet.wire.encoding import encode_finite
from fleet.wire.strict_json import parse_object


def ping(*, stamp: float, session: str) -> bytes:
    """Return the ping request, in the SDK's form."""
    return encode_finite({"type": "ping", "timestamp": stamp, "session_id": session})


def pong(*, stamp: float, edge_id: str, source_type: str, session: str) -> bytes:
    """Return an edge's answer to a ping; ``stamp`` is the time of sending (Unix seconds)."""
    return encode_finite(
        {
            "type": "pong",
            "timestamp": stamp,
            "edge_id": edge_id,
            "source_type": source_type,
            "session_id": session,
        }
    )


def check_ping(payload: bytes) -> None:
    """Raise WireError unless a payload is a ping."""
    found = parse_object(payload, limit=4096, depth=8).get("type")
    if found != "ping":
        raise WireError(f"'ping' is needed, this is {str(found)[:40]!a}", where="type")


def is_clouds_pong(payload: bytes) -> bool:
    """Return True for the cloud's answer, False for that of an edge; raises WireError for anything else."""
    message = parse_object(payload, limit=4096, depth=8)
    if message.get("type") not in ("pong", None):
        raise WireError("'pong' is needed", where="type")
    return "edge_id" not in message
