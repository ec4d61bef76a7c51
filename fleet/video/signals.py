"""WebRTC's messages as Cyberwave's media service and frontend have them (contract 10): made and read."""

from __future__ import annotations

from typing import Any

import msgspec

from fleet.errors import WireError
from fleet.runtime.decoding import json_decoder
from fleet.wire.samples import json_payload

SOURCE, INSTANCE = "live", "default"  # which stream of a sensor a message is about that does not say


class VideoStream(msgspec.Struct, frozen=True):
    """What tells one stream from the others of a twin; ``session`` is of this program."""

    sensor: str
    track: str
    session: str


class Candidate(msgspec.Struct, frozen=True, rename={"mid": "sdpMid", "index": "sdpMLineIndex"}):
    """One ICE candidate: its line of SDP, empty after the last one, and the part of the offer it is for."""

    candidate: str
    mid: str | None = None
    index: int | None = None


class _Answer(msgspec.Struct):
    """An answer, as far as it matters here; ``camera`` is an older word for the sensor."""

    sdp: str
    type: str = ""
    target: str = ""
    sensor: str | None = None
    camera: str | None = None
    stream_source: str | None = None
    stream_instance_id: str | None = None


class _Wrapped(msgspec.Struct):
    """A candidate inside a message."""

    candidate: Candidate


_ANSWER: msgspec.json.Decoder[_Answer] = json_decoder(_Answer)
_CANDIDATE: msgspec.json.Decoder[Candidate] = json_decoder(Candidate)
_WRAPPED: msgspec.json.Decoder[_Wrapped] = json_decoder(_Wrapped)


def offer_message(
    sdp: str, stream: VideoStream, *, recording: bool, attributes: dict[str, object], stamp: float
) -> dict[str, object]:
    """Return the message of an offer; ``attributes`` are width, height and fps, ``stamp`` is Unix seconds."""
    return {
        "target": "backend",
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
    """Return the SDP of an answer to a sensor's offer, None for one that is for another. Raises WireError."""
    answer: _Answer = _read(sample, _ANSWER)
    ours = (
        (answer.type, answer.target) == ("answer", "edge")
        and "m=video" in answer.sdp
        and (answer.sensor or answer.camera or sensor) == sensor
        and (answer.stream_source or SOURCE) == SOURCE
        and (answer.stream_instance_id or INSTANCE) == INSTANCE
    )
    return answer.sdp if ours else None


def candidate_in(sample: bytes) -> Candidate:
    """Return the candidate in a message: as a browser's own object, inside one, or flat. Raises WireError."""
    try:
        found = _WRAPPED.decode(json_payload(sample)).candidate
    except (msgspec.DecodeError, ValueError, RecursionError):
        found = _read(sample, _CANDIDATE)
    line = found.candidate.removeprefix("a=").removeprefix("candidate:")
    if line and found.mid is None and found.index is None:
        raise WireError("needs sdpMid or sdpMLineIndex", where="candidate")
    return Candidate(line, found.mid, found.index)


def _read(sample: bytes, decoder: msgspec.json.Decoder[Any]) -> Any:
    """Read the JSON of a sample."""
    try:
        return decoder.decode(json_payload(sample))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where="webrtc") from None
