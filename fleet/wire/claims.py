"""Who has a twin: told by the ``edge_health`` of its edge, of which there may be only one."""

from __future__ import annotations

import msgspec

from fleet.errors import WireError
from fleet.wire.strict import number, parse_object, text


class EdgeHeartbeat(msgspec.Struct, frozen=True):
    """An edge that says that it serves a twin; ``uptime`` in seconds."""

    edge: str
    session: str
    uptime: float

    def comes_before(self, other: EdgeHeartbeat) -> bool:
        """Return True when this edge had the twin first; each edge comes to the same result about the other.

        Edges that began within the same second are told apart by their names.
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
