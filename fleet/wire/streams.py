"""States of streams that bus programs send to the cloud, for ``edge_health.streams`` (contract 9.2).

A program that sends video, sound or scans publishes the state of each stream on
``cw/{twin}/data/streams/{id}``, as JSON with or without Cyberwave's header, at least every ``LIFETIME``
seconds; the published SDK can do so.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from fleet.errors import WireError
from fleet.runtime.decoding import json_decoder
from fleet.wire.samples import json_payload

CHANNEL = "streams"
LIFETIME = 10.0  # s without a state after which a stream counts as ended
STALE = 60.0  # s without a frame, as in the SDK
LARGEST = 4096  # bytes of a sample

_Count = Annotated[int, msgspec.Meta(ge=0)]
_Amount = Annotated[float, msgspec.Meta(ge=0)]


class StreamState(msgspec.Struct, frozen=True):
    """State of one stream, published by its program.

    ``last_frame_ts`` is Unix seconds, None before the first frame; ``fps`` the current frames a second;
    ``stream_config`` its description: ``kind`` (camera, audio, lidar or imu) and the fields of that kind.
    """

    connection_state: Literal["connecting", "connected", "disconnected"]
    ice_connection_state: str = "new"
    camera_id: str = ""
    frames_sent: _Count = 0
    last_frame_ts: float | None = None
    fps: _Amount = 0.0
    uptime_seconds: _Amount = 0.0
    restart_count: _Count = 0
    stream_config: dict[str, Any] | None = None


_STREAM: msgspec.json.Decoder[StreamState] = json_decoder(StreamState)


def read_stream(sample: bytes) -> StreamState | None:
    """Decode the state of a stream; None for an empty sample, which ends the stream. Raises WireError."""
    if not sample:
        return None
    if len(sample) > LARGEST:
        raise WireError(f"{len(sample)} bytes are more than the {LARGEST} of a stream", where=CHANNEL)
    try:
        return _STREAM.decode(json_payload(sample))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where=CHANNEL) from None


def health_of(name: str, stream: StreamState, *, now: float) -> dict[str, object]:
    """Return a stream's entry in ``edge_health``, the SDK's fields in its order; ``now`` in Unix seconds.

    A stream is stale after ``STALE`` seconds without a frame, and healthy while connected and not stale.
    """
    silent = stream.uptime_seconds if stream.last_frame_ts is None else now - stream.last_frame_ts
    is_stale = silent > STALE
    entry: dict[str, object] = {
        "camera_id": stream.camera_id or name,
        "connection_state": stream.connection_state,
        "ice_connection_state": stream.ice_connection_state,
        "frames_sent": stream.frames_sent,
        "last_frame_ts": stream.last_frame_ts,
        "fps": round(stream.fps, 2),
        "uptime_seconds": round(stream.uptime_seconds, 1),
        "restart_count": stream.restart_count,
        "is_stale": is_stale,
        "is_healthy": stream.connection_state == "connected" and not is_stale,
    }
    return entry if stream.stream_config is None else {**entry, "stream_config": stream.stream_config}
