"""Replies to commands: ``twin.command_response.v1`` for a request with a Response Topic, else a status."""

from __future__ import annotations

import msgspec

from fleet.model.command import Reply
from fleet.wire.encoding import encode_finite


def command_response(reply: Reply, *, twin: str, source_type: str, stamp: float) -> bytes:
    """Return a reply as ``twin.command_response.v1``, whose ``source_type`` can only be edge or sim.

    Empty fields are omitted. Two fields are added to those of the contract: ``done`` once the outcome is
    known, and ``data`` with the result of a query.
    """
    message: dict[str, object] = {
        "contract": "twin.command_response.v1",
        "twin_uuid": twin,
        "command": reply.command,
        "status": reply.status.value,
        "source_type": "sim" if source_type == "sim" else "edge",
        "timestamp": stamp,
        **_details(reply),
    }
    if reply.done is not None:
        message["done"] = reply.done
    return encode_finite(message)


def legacy_status(reply: Reply, *, stamp: float, source_type: str, request: str = "") -> bytes:
    """Return a reply for the command topic itself, where its ``status`` distinguishes it from a command.

    It has ``done`` once the outcome is known. ``request`` is the sender's own id of the request (its
    Correlation Data), omitted when empty.
    """
    message: dict[str, object] = {
        "status": "ok" if reply.ok else "error",
        "ok": reply.ok,
        "command": reply.command,
        "source_type": source_type,
        "timestamp": stamp,
        **_details(reply),
    }
    if reply.done is not None:
        message["done"] = reply.done
    if request:
        message["correlation_id"] = request
    return encode_finite(message)


def _details(reply: Reply) -> dict[str, object]:
    """Return the reason, the robot's own result and messages, and the result of a query."""
    reason = f"{reply.reason} ({reply.hint})" if reply.hint else reply.reason
    details: dict[str, object] = {
        "reason": reason,
        "device_result": reply.device_result,
        "messages": reply.messages,
    }
    if reply.data is not None:  # data of an adapter may hold NaN, which msgspec encodes as null
        details["data"] = msgspec.json.decode(msgspec.json.encode(reply.data))
    return {name: value for name, value in details.items() if value or name == "data"}
