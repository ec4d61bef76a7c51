"""Messages of ``start_video`` and ``stop_video``, between the edge and the program that sends the video.

The edge sends a query on the bus (``fleet.bus.keys.video``), the program replies, and the edge publishes the
result on ``T {command}/status``, as the SDK's drivers do.
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
"""The ``type`` of the status message of each command."""
LOCAL_OFFER, LOCAL_ANSWER = "local/webrtc_offer", "local/webrtc_answer"
"""Channels of the signalling with a viewer on the bus."""
STATUS_CHANNELS: Mapping[str, str] = MappingProxyType({name: f"{name}_status" for name in VIDEO_TYPES})
"""The bus channel of the status of each command, for those that the cloud has not sent."""


class VideoRequest(msgspec.Struct, frozen=True):
    """Request to the video program.

    ``data`` is that of the command: ``recording``, ``sensor`` or ``sensor_id`` to select one camera, and
    ``viewer: local`` for a viewer on the bus instead of one in the cloud.
    """

    command: Literal["start_video", "stop_video"]
    data: dict[str, Any] = {}

    def is_for(self, sensor: str) -> bool:
        """Return False when the request names another sensor."""
        named = self.data.get("sensor") or self.data.get("sensor_id") or sensor
        return bool(named == sensor)

    @property
    def recording(self) -> bool:
        """Whether the cloud is to record the video; the default is yes."""
        return self.data.get("recording") is not False

    @property
    def local(self) -> bool:
        """Whether the viewer is on the bus, as a console; then no video goes to the cloud."""
        return self.data.get("viewer") == "local"


class VideoReply(msgspec.Struct, frozen=True, omit_defaults=True):
    """Reply of the video program: success, else the reason."""

    ok: bool
    reason: str = ""


def video_request(command: Command) -> bytes:
    """Encode a request to the video program."""
    return encode_finite({"command": command.name, "data": dict(command.data)})


def read_video_request(payload: bytes) -> VideoRequest:
    """Decode a request; raises WireError."""
    return _read(payload, VideoRequest)


def read_video_reply(payload: bytes) -> VideoReply:
    """Decode the program's reply; raises WireError."""
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
    """Decode JSON to a type; raises WireError."""
    try:
        return decode_json(payload, kind)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where="video") from None
