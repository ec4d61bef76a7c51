"""Messages of the Foxglove WebSocket protocol that a read-only server needs; pure.

Source: the specification in https://github.com/foxglove/ws-protocol. The protocol of Foxglove's SDK is the
same under a newer name.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Annotated

import msgspec

from fleet.errors import WireError
from fleet.record.schemas import schema_of
from fleet.runtime.decoding import decode_json
from fleet.version import __version__

PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Names of the protocol in the handshake, newest first."""
MOST_AT_ONCE = 1000  # subscriptions in one message
_MESSAGE = 0x01  # opcode
_HEAD = struct.Struct("<BIQ")  # opcode, subscription, received (Unix ns)
_WARNING = 1
_encode = msgspec.json.Encoder().encode

Uint32 = Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]


class FoxgloveChannel(msgspec.Struct, frozen=True):
    """A topic with its schema; ``number`` is its identity for clients."""

    number: int
    topic: str
    schema: str


class FoxgloveSubscription(msgspec.Struct, frozen=True, rename="camel"):
    """Subscription to a channel; ``id`` is the client's number for it."""

    id: Uint32
    channel_id: Uint32


class Subscribe(msgspec.Struct, frozen=True, rename="camel", tag_field="op", tag="subscribe"):
    """Subscribes to channels."""

    subscriptions: Annotated[tuple[FoxgloveSubscription, ...], msgspec.Meta(max_length=MOST_AT_ONCE)]


class Unsubscribe(msgspec.Struct, frozen=True, rename="camel", tag_field="op", tag="unsubscribe"):
    """Ends subscriptions."""

    subscription_ids: Annotated[tuple[Uint32, ...], msgspec.Meta(max_length=MOST_AT_ONCE)]


class _Op(msgspec.Struct, frozen=True):
    """The kind of a message."""

    op: str


ViewerRequest = Subscribe | Unsubscribe


def read_requested(message: str | bytes) -> ViewerRequest:
    """Decode a message of a client; raises WireError, also for operations that a read-only view refuses."""
    if isinstance(message, bytes):
        raise WireError("this view is read-only: it takes no data")
    data = message.encode(errors="replace")
    try:
        kind = decode_json(data, _Op).op
        if kind not in {"subscribe", "unsubscribe"}:
            raise WireError(f"this view is read-only: {kind[:40]} is not taken")
        found: ViewerRequest = decode_json(data, ViewerRequest)  # type: ignore[arg-type]
    except msgspec.DecodeError as error:
        raise WireError(f"it cannot be read: {error}") from None
    return found


def server_info(session: str) -> str:
    """Return the first message to a client; it announces no capabilities except channels."""
    info = {"op": "serverInfo", "name": f"fleet {__version__}", "capabilities": [], "sessionId": session}
    return _encode(info).decode()


def advertisement(channels: Iterable[FoxgloveChannel]) -> str:
    """Return the message that offers channels."""
    offered = [
        {
            "id": each.number,
            "topic": each.topic,
            "encoding": "json",
            "schemaName": each.schema,
            "schema": schema_of(each.schema).decode(),
            "schemaEncoding": "jsonschema",
        }
        for each in channels
    ]
    return _encode({"op": "advertise", "channels": offered}).decode()


def warning(text: str) -> str:
    """Return a message that a client shows to its user."""
    return _encode({"op": "status", "level": _WARNING, "message": text}).decode()


def message_data(subscription: int, received: int, payload: bytes) -> bytes:
    """Return a message on a subscription; ``received`` in Unix ns."""
    return _HEAD.pack(_MESSAGE, subscription, received) + payload
