"""``start_video`` and ``stop_video``: what the program that sends a robot's video is asked, and its answer.

The edge asks on the bus (``fleet.bus.keys.video``), the program answers, and the cloud is told on
``T {command}/status``, as the SDK's drivers tell it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal, TypeVar

import msgspec

from fleet.errors import WireError
from fleet.model.command import Command, Reply
from fleet.runtime.decoding import decode_json
from fleet.wire.encoding import encode_finite

T = TypeVar("T")

VIDEO_TYPES: Mapping[str, str] = MappingProxyType(
    {"start_video": "video_started", "stop_video": "video_stopped"}
)
"""The ``type`` of each command's status."""


class VideoRequest(msgspec.Struct, frozen=True):
    """What the program is asked.

    ``data`` is the command's: ``recording``, and ``sensor`` or ``sensor_id`` where one camera is meant.
    """

    command: Literal["start_video", "stop_video"]
    data: dict[str, Any] = {}

    def is_for(self, sensor: str) -> bool:
        """Return False when another sensor is named."""
        named = self.data.get("sensor") or self.data.get("sensor_id") or sensor
        return bool(named == sensor)

    @property
    def recording(self) -> bool:
        """Whether the cloud is to record it; it is unless the command says otherwise."""
        return self.data.get("recording") is not False


class VideoReply(msgspec.Struct, frozen=True, omit_defaults=True):
    """What the program answers: whether it did it, else why not."""

    ok: bool
    reason: str = ""


def video_request(command: Command) -> bytes:
    """Return what to ask the program."""
    return encode_finite({"command": command.name, "data": dict(command.data)})


def read_video_request(payload: bytes) -> VideoRequest:
    """Return what is asked; raises WireError."""
    return _read(payload, VideoRequest)


def read_video_reply(payload: bytes) -> VideoReply:
    """Return what the program answered; raises WireError."""
    return _read(payload, VideoReply)


def video_status(reply: Reply, *, stamp: float, source_type: str) -> bytes:
    """Return the message for ``T {command}/status``; ``stamp`` in Unix seconds."""
    message: dict[str, object] = {
        "type": VIDEO_TYPES[reply.command],
        "status": "ok" if reply.ok else "error",
        "source_type": source_type,
        "timestamp": stamp,
    }
    return encode_finite(message if reply.ok else message | {"reason": reply.reason})


def _read(payload: bytes, kind: type[T]) -> T:
    """Read JSON of a type."""
    try:
        return decode_json(payload, kind)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where="video") from None
