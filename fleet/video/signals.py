"""Codec of WebRTC signalling messages of Cyberwave's media service and frontend (contract 10)."""

from __future__ import annotations

from typing import Any

import msgspec

from fleet.errors import WireError
from fleet.runtime.decoding import json_decoder
from fleet.wire.samples import json_payload

SOURCE, INSTANCE = "live", "default"  # the stream meant by a message that names none


class VideoStream(msgspec.Struct, frozen=True):
    """Identity of one stream of a twin; ``session`` is that of this program."""

    sensor: str
    track: str
    session: str


class IceCandidate(msgspec.Struct, frozen=True, rename={"mid": "sdpMid", "index": "sdpMLineIndex"}):
    """One ICE candidate: its SDP line, empty after the last one, and the media section it belongs to."""

    candidate: str
    mid: str | None = None
    index: int | None = None


class _SdpAnswer(msgspec.Struct):
    """The fields of an answer that are used here; ``camera`` is an older name for the sensor."""

    sdp: str
    type: str = ""
    target: str = ""
    sensor: str | None = None
    camera: str | None = None
    stream_source: str | None = None
    stream_instance_id: str | None = None


class _Wrapped(msgspec.Struct):
    """A candidate inside a message."""

    candidate: IceCandidate


_ANSWER: msgspec.json.Decoder[_SdpAnswer] = json_decoder(_SdpAnswer)
_CANDIDATE: msgspec.json.Decoder[IceCandidate] = json_decoder(IceCandidate)
_WRAPPED: msgspec.json.Decoder[_Wrapped] = json_decoder(_Wrapped)


def offer_message(
    sdp: str,
    stream: VideoStream,
    *,
    recording: bool,
    attributes: dict[str, object],
    stamp: float,
    target: str = "backend",
) -> dict[str, object]:
    """Return an offer message; ``attributes`` are width, height and fps, ``stamp`` is Unix seconds."""
    return {
        "target": target,
        "sender": "edge",
        "type": "offer",
        "sdp": sdp,
        "timestamp": stamp,
        "recording": recording,
        "stream_attributes": attributes,
        "sensor": stream.sensor,
        "track_id": stream.track,
        "color_track_id": stream.track,
        "session_id": stream.session,
        "stream_source": SOURCE,
        "stream_instance_id": INSTANCE,
        "frontend_type": "rgb",
    }


def answer_for(sample: bytes, sensor: str) -> str | None:
    """Return the SDP of an answer to a sensor's offer, None for another stream's. Raises WireError."""
    answer: _SdpAnswer = _read(sample, _ANSWER)
    ours = (
        (answer.type, answer.target) == ("answer", "edge")
        and "m=video" in answer.sdp
        and (answer.sensor or answer.camera or sensor) == sensor
        and (answer.stream_source or SOURCE) == SOURCE
        and (answer.stream_instance_id or INSTANCE) == INSTANCE
    )
    return answer.sdp if ours else None


def candidate_in(sample: bytes) -> IceCandidate:
    """Return the candidate in a message, nested or flat, as browsers write it. Raises WireError."""
    try:
        found = _WRAPPED.decode(json_payload(sample)).candidate
    except (msgspec.DecodeError, ValueError, RecursionError):
        found = _read(sample, _CANDIDATE)
    line = found.candidate.removeprefix("a=").removeprefix("candidate:")
    if line and found.mid is None and found.index is None:
        raise WireError("needs sdpMid or sdpMLineIndex", where="candidate")
    return IceCandidate(line, found.mid, found.index)


def _read(sample: bytes, decoder: msgspec.json.Decoder[Any]) -> Any:
    """Decode the JSON of a sample; raises WireError."""
    try:
        return decoder.decode(json_payload(sample))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where="webrtc") from None
