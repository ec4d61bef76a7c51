"""Claims on twins: ``edge_health`` messages show which edge serves a twin; only one edge may."""

from __future__ import annotations

import msgspec

from fleet.errors import WireError
from fleet.wire.strict_json import number, parse_object, text


class EdgeHeartbeat(msgspec.Struct, frozen=True):
    """Claim of one edge to serve a twin; ``uptime`` in seconds."""

    edge: str
    session: str
    uptime: float

    def is_older_than(self, other: EdgeHeartbeat) -> bool:
        """Return True when this edge has the older claim; both edges come to the same result.

        Edges that started within the same second are ordered by name.
        """
        if abs(self.uptime - other.uptime) >= 1.0:
            return self.uptime > other.uptime
        return (self.edge, self.session) < (other.edge, other.session)


def read_heartbeat(payload: bytes) -> EdgeHeartbeat:
    """Return the heartbeat in an ``edge_health`` message; raises WireError for anything else."""
    message = parse_object(payload, limit=1 << 16)
    if message.get("type") != "edge_health":
        raise WireError("'edge_health' is needed", where="type")
    session = message.get("session_id")
    if session is not None and not isinstance(session, str):
        raise WireError("a string is needed", where="session_id")
    uptime = number(message, "uptime_seconds") if "uptime_seconds" in message else 0.0
    edge = text(message, "edge_id")
    if not edge:
        raise WireError("an edge has a name", where="edge_id")
    return EdgeHeartbeat(edge, session or "", uptime)
