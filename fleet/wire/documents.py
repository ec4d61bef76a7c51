"""Documents: JSON objects that the bridge passes between the bus and MQTT, checked and stamped.

A message of a bus program about a twin is tagged like a report; a WebRTC message, which has a ``session_id``
of its own, is not. A message that is not JSON, has the wrong ``type`` or lacks a field that its readers need
is not passed, in either direction.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

import msgspec

from fleet.errors import WireError
from fleet.runtime.decoding import json_decoder
from fleet.wire.encoding import encode_finite
from fleet.wire.envelope import stamp_of
from fleet.wire.joints import STATE_SENDERS
from fleet.wire.published import object_in, stamp_in
from fleet.wire.samples import json_sample
from fleet.wire.strict_json import child, finite, kind, parse_object, path

UPDATE_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,63}")
"""Types of environment updates: an open list of words that can be a topic level."""


class Shape(msgspec.Struct, frozen=True):
    """Required content of a document: its type, ``says`` (empty: any), and its fields with their types.

    ``one_of``: at least one of these fields must be present. ``tagged``: source type and session are added,
    as to a report. ``aimed``: the message has no ``target``, so the cloud's is added on the way out; the
    edge then recognises its own message when the broker delivers it back.
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
"""Required content by suffix; documents with other suffixes only have to be JSON objects."""
_RAW_CANDIDATE = Shape(
    needs=MappingProxyType({"candidate": (str,)}),
    one_of=MappingProxyType({"sdpMid": (str,), "sdpMLineIndex": (int,)}),
    tagged=False,
    aimed=True,
)
"""Result of a browser's ``RTCIceCandidate.toJSON()``, without the usual message around it."""


EDITED = frozenset({"position", "rotation", "scale"})
"""Suffixes that the twin editor writes; the field of the same name holds a value per axis.

Edges and simulations publish the same topics as state.
"""


class _Tagged(msgspec.Struct):
    """Only the source type of a message."""

    source_type: str | None = None


class _Aimed(msgspec.Struct):
    """Only the ``target`` of a WebRTC message: other fields may contain the same words."""

    target: str


_TARGET: msgspec.json.Decoder[_Aimed] = json_decoder(_Aimed)
_SENDER: msgspec.json.Decoder[_Tagged] = json_decoder(_Tagged)
_OPEN = Shape()
_CLOUD = "backend"


def document_out(suffix: str, sample: bytes, *, source_type: str, session: str) -> bytes:
    """Return the MQTT message for a document on the bus; its stamp is its own, else the header's.

    Raises WireError unless it is a JSON object with the fields that the suffix needs and with a stamp.
    """
    message = object_in(sample, suffix)
    shape = _checked(suffix, message)
    message["timestamp"] = stamp_in(message, sample)
    message.pop("ts", None)
    if suffix.startswith("environment:"):
        message = {"type": suffix.partition(":")[2], **message}
    if shape.aimed:
        message["target"] = _CLOUD
    if shape.tagged:
        message |= {"source_type": source_type} | ({"session_id": session} if session else {})
    return encode_finite(message)


def document_in(suffix: str, payload: bytes, *, size: int, now: float) -> bytes:
    """Return the bus sample for a document of the cloud; ``now`` is the stamp of one without a stamp.

    Raises WireError unless it is a strict JSON object of at most ``size`` bytes with the required fields.
    """
    message = parse_object(payload, limit=size)
    _checked(suffix, message)
    if suffix.startswith("environment:"):
        message = {"type": suffix.partition(":")[2], **message}
    if suffix in EDITED:
        _check_edit(suffix, message)
    stamp = stamp_of(message)
    return json_sample(encode_finite(message), stamp=now if stamp is None else stamp, sequence=0)


def word_of_update(update: str) -> str:
    """Return the type of an update as part of a bus key, which allows only lower-case words."""
    return re.sub(r"[^a-z0-9_]", "_", update.lower())


def is_for_the_cloud(suffix: str, payload: bytes) -> bool:
    """Return True for a WebRTC message addressed to the cloud: our own, delivered back by the broker."""
    if not suffix.startswith("webrtc-") or b'"backend"' not in payload:
        return False
    try:
        return _TARGET.decode(payload).target == _CLOUD
    except (ValueError, RecursionError):  # ``document_in`` says what is wrong with it
        return False


def is_state_of_another(suffix: str, payload: bytes) -> bool:
    """Return True for a measured or simulated state of a twin, as opposed to a change by the editor."""
    if suffix not in EDITED:
        return False
    try:
        return _SENDER.decode(payload).source_type in STATE_SENDERS
    except (ValueError, RecursionError):  # ``document_in`` says what is wrong with it
        return False


def _check_edit(suffix: str, message: Mapping[str, object]) -> None:
    """Raise WireError unless the message is a change by the editor."""
    if message.get("source_type") != "edit":
        raise WireError(f"edit is needed, not {str(message.get('source_type'))[:40]!a}", where="source_type")
    for axis, value in child(message, suffix).items():
        finite(value, path(suffix, axis))


def _checked(suffix: str, message: Mapping[str, object]) -> Shape:
    """Check a message against the shape of its suffix and return the shape; raises WireError."""
    namespace, _, update = suffix.partition(":")
    if namespace == "environment" and not UPDATE_TYPE.fullmatch(update):
        raise WireError(f"{update[:40]!a} cannot be the type of an update", where="environment")
    raw = suffix == _CANDIDATE and "type" not in message
    shape = _RAW_CANDIDATE if raw else SHAPES.get(suffix, _OPEN)
    if shape.says and message.get("type") != shape.says:
        raise WireError(f"{shape.says!a} is needed, this is {str(message.get('type'))[:40]!a}", where="type")
    for name, types in shape.needs.items():
        if name not in message:
            raise WireError("is missing", where=path(suffix, name))
        if not isinstance(message[name], types):
            raise WireError(f"this is {kind(message[name])}", where=path(suffix, name))
    if shape.one_of and not any(isinstance(message.get(name), of) for name, of in shape.one_of.items()):
        raise WireError(f"needs {' or '.join(shape.one_of)}", where=suffix)
    return shape
