"""Messages that cross as they are: JSON objects between the bus and MQTT, checked and stamped.

What a program on the bus says about a twin is tagged like a report; WebRTC's messages, which have a
``session_id`` of their own, are not. Nothing that is not JSON, has the wrong ``type`` or lacks what its
readers need crosses in either direction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from fleet.decoding import json_decoder
from fleet.errors import WireError
from fleet.wire.encoding import encode_finite
from fleet.wire.envelope import stamp_of
from fleet.wire.samples import json_payload, json_sample, stamp_of_header
from fleet.wire.strict import kind, parse_object, path

UPDATE_TYPES = frozenset({"update", "twin_added", "twin_deleted", "twin_updated", "sensor_binding", "event"})
"""The kinds of an environment's update that are told and taken."""


class Shape(msgspec.Struct, frozen=True):
    """What a document must hold: its type, ``says`` (empty: any), and fields with what they may be.

    ``one_of`` are fields of which one must be there. ``tagged``: it gets source type and session like a
    report. ``aimed``: it has no ``target`` of its own, and goes out with the cloud's, so that we know it when
    the broker brings it back to us.
    """

    says: str = ""
    needs: Mapping[str, tuple[type, ...]] = MappingProxyType({})
    one_of: Mapping[str, tuple[type, ...]] = MappingProxyType({})
    tagged: bool = True
    aimed: bool = False


_CANDIDATE = "webrtc-candidate"
_SDP = MappingProxyType({"target": (str,), "sdp": (str,)})
SHAPES: Mapping[str, Shape] = MappingProxyType(
    {
        "webrtc-offer": Shape("offer", _SDP, tagged=False),
        "webrtc-answer": Shape("answer", _SDP, tagged=False),
        _CANDIDATE: Shape(
            "candidate", MappingProxyType({"target": (str,), "candidate": (dict, str)}), tagged=False
        ),
        "event": Shape(needs=MappingProxyType({"event_type": (str,)})),
        "map_update": Shape(needs=MappingProxyType({"map_type": (str,)})),
        "alert": Shape(needs=MappingProxyType({"name": (str,)})),
        "workflow-run:status": Shape(needs=MappingProxyType({"status": (str,)})),
    }
)
"""By leaf; what is not here only has to be a JSON object."""
_RAW_CANDIDATE = Shape(
    needs=MappingProxyType({"candidate": (str,)}),
    one_of=MappingProxyType({"sdpMid": (str,), "sdpMLineIndex": (int,)}),
    tagged=False,
    aimed=True,
)
"""What a browser's ``RTCIceCandidate.toJSON()`` gives, without the usual message around it."""


class _Aimed(msgspec.Struct):
    """A WebRTC message, as far as it says whom it is for; others may be named in it, too."""

    target: str


_TARGET: msgspec.json.Decoder[_Aimed] = json_decoder(_Aimed)
_OPEN = Shape()
_CLOUD = "backend"
_DECODER: msgspec.json.Decoder[dict[str, Any]] = json_decoder(dict[str, Any])


def document_out(leaf: str, sample: bytes, *, source_type: str, session: str) -> bytes:
    """Return the MQTT message of a document on the bus; its stamp is its own, else the header's.

    Raises WireError for what is no JSON object, lacks what the leaf needs, or has no stamp at all.
    """
    try:
        message = _DECODER.decode(json_payload(sample))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where=leaf) from None
    shape = _checked(leaf, message)
    message["timestamp"] = _stamp(message, sample)
    message.pop("ts", None)
    if leaf.startswith("environment:"):
        message = {"type": leaf.partition(":")[2], **message}
    if shape.aimed:
        message["target"] = _CLOUD
    if shape.tagged:
        message |= {"source_type": source_type} | ({"session_id": session} if session else {})
    return encode_finite(message)


def document_in(leaf: str, payload: bytes, *, size: int, now: float) -> bytes:
    """Return the sample to put on the bus for a document of the cloud; ``now`` stamps one without a stamp.

    Raises WireError for what is no strict JSON object of at most ``size`` bytes, or lacks what it needs.
    """
    message = parse_object(payload, limit=size)
    _checked(leaf, message)
    stamp = stamp_of(message)
    return json_sample(encode_finite(message), stamp=now if stamp is None else stamp, sequence=0)


def is_for_the_cloud(leaf: str, payload: bytes) -> bool:
    """Return True for a WebRTC message that is on its way to the cloud: ours, come back to us."""
    if not leaf.startswith("webrtc-") or b'"backend"' not in payload:
        return False
    try:
        return _TARGET.decode(payload).target == _CLOUD
    except (ValueError, RecursionError):  # ``document_in`` says what is wrong with it
        return False


def _checked(leaf: str, message: Mapping[str, Any]) -> Shape:
    """Return the shape of a leaf, which the message must have."""
    namespace, _, update = leaf.partition(":")
    if namespace == "environment" and update not in UPDATE_TYPES:
        known = ", ".join(sorted(UPDATE_TYPES))
        raise WireError(f"{update[:40]!a} is not an update of an environment ({known})", where=leaf)
    raw = leaf == _CANDIDATE and "type" not in message
    shape = _RAW_CANDIDATE if raw else SHAPES.get(leaf, _OPEN)
    if shape.says and message.get("type") != shape.says:
        raise WireError(f"{shape.says!a} is needed, this is {str(message.get('type'))[:40]!a}", where="type")
    for name, types in shape.needs.items():
        if name not in message:
            raise WireError("is missing", where=path(leaf, name))
        if not isinstance(message[name], types):
            raise WireError(f"this is {kind(message[name])}", where=path(leaf, name))
    if shape.one_of and not any(isinstance(message.get(name), of) for name, of in shape.one_of.items()):
        raise WireError(f"needs {' or '.join(shape.one_of)}", where=leaf)
    return shape


def _stamp(message: Mapping[str, Any], sample: bytes) -> float:
    """Return when a document was made; raises WireError when nothing says so."""
    stamp = stamp_of(message)
    stamp = stamp_of_header(sample) if stamp is None else stamp
    if stamp is None or not math.isfinite(stamp):
        raise WireError("is missing, and so is the sample's header", where="timestamp")
    return stamp
