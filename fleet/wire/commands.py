"""Decoder of ``T command`` and ``T motion/command``: messages to commands and velocity setpoints.

Four sign conventions are in use for the same verbs. One rule satisfies all of them: the verb fixes axis
and sign, the magnitude is the absolute value of the verb's own field, else of ``linear_x``, else a default;
``distance`` is a displacement. Only ``move``, the velocity contracts and twists carry signed fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

from fleet.errors import WireError
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity
from fleet.runtime.decoding import json_decoder
from fleet.wire.envelope import (
    LONGEST_NAME,
    BadCommand,
    identity,
    name_of,
    origin_and_stamp,
    sampled_object,
    seconds_of,
    stop_requested,
    tolerant,
)
from fleet.wire.spelling import refuse_misspelt, refuse_unknown
from fleet.wire.stops import EMERGENCY, STOP_WORDS, is_reply, releases, stop_word
from fleet.wire.strict_json import LARGEST_INTEGER, child, number, optional_number, parse_object
from fleet.wire.velocity import read_velocity_contract
from fleet.wire.verbs import VERBS, Axis
from fleet.wire.video import VIDEO_TYPES

VELOCITY_FIELDS = ("linear_x", "linear_y", "linear_z", "angular_z")
_VELOCITY = frozenset(VELOCITY_FIELDS)
_VERB_DATA = _VELOCITY | {"distance"}
_FLAT_TWIST = _VELOCITY | {"angular_x", "angular_y"}  # roll and pitch rates are not used
_UNITS: Mapping[str, str] = MappingProxyType({"distance": "m", "angular_z": "rad/s"})
_TWIST = frozenset({"linear", "angular"})
_AXES = frozenset("xyz")
_BODIES = frozenset({"data", "velocity_command"})


class MotionDefaults(msgspec.Struct, frozen=True):
    """Default magnitudes for a verb without one: m/s, and rad/s for ``yaw_rate``."""

    forward: float
    lateral: float
    vertical: float
    yaw_rate: float


SETTINGS: Mapping[str, str] = MappingProxyType(
    {"set_linear_velocity": "linear", "set_angular_velocity": "angular"}
)
"""Commands that set the default magnitude of later verbs, and the field of their data (m/s or rad/s)."""

Defaults = Callable[[str], MotionDefaults]
"""Returns the default magnitudes of a session, by its id."""

_Integer = Annotated[int, msgspec.Meta(ge=-LARGEST_INTEGER, le=LARGEST_INTEGER)]


class _Usual(msgspec.Struct):
    """The common form of a command message, decoded in one call; any other form is decoded step by step.

    Without it a message from the broker to the robot costs 1.9 times as much (bench bridge:inward).
    """

    command: Annotated[str, msgspec.Meta(max_length=LONGEST_NAME)]
    source_type: str
    timestamp: Annotated[float, msgspec.Meta(ge=0.0, lt=2.0**63)]
    data: dict[str, _Integer | float | str | bool | None]
    session_id: str | None = None


_USUAL: msgspec.json.Decoder[_Usual] = json_decoder(_Usual)


class _Envelope(msgspec.Struct, frozen=True):
    """Fields that all command messages share, before the command itself is interpreted."""

    name: str
    data: dict[str, Any]
    message: dict[str, Any]
    payload: bytes
    request_id: str
    origin: Origin
    stamp: float | None

    def command(self, name: str, data: Mapping[str, object]) -> Command:
        """Return a command with the sender and stamp of this message."""
        same = identity(self.payload, self.stamp, self.request_id, (name, data))
        return Command(name, data, self.origin, same, self.stamp)

    def setpoint(self, velocity: Velocity, lease: float | None = None) -> Setpoint:
        """Return a setpoint with the sender and stamp of this message."""
        return Setpoint(velocity, self.name, lease, self.origin, self.stamp)


def decode_command(
    payload: bytes, *, transport: Transport, request_id: str = "", defaults: Defaults, twin: str = ""
) -> Command | Setpoint | None:
    """Decode a message on ``T command``; None when it is itself a reply (it has a ``status``).

    ``request_id`` is the sender's own id (Correlation Data, a query's id). ``twin`` is the twin of the topic:
    a message that names another one is refused. Raises BadCommand, a WireError with the name of the command
    where that could be read.
    """
    name = ""
    try:
        read = _usual(payload)
        if read is not None:
            name = read.command
            origin, stamp = (
                Origin(transport, read.source_type, read.session_id or ""),
                seconds_of(read.timestamp),
            )
            meaning = _MEANINGS.get(name)
            if meaning is None:
                name = stop_word(name) or name
                same = identity(payload, stamp, request_id, (name, read.data))
                return Command(name, read.data, origin, same, stamp)
            return meaning(_Envelope(name, read.data, {}, payload, request_id, origin, stamp), defaults)
        message = parse_object(payload)
        if is_reply(message):
            return None
        name = name_of(message)
        envelope = _envelope(name, message, payload, transport, request_id, twin=twin)
        return _MEANINGS.get(name, _plain)(envelope, defaults)
    except WireError as error:
        raise BadCommand(error, command=name) from None


def decode_motion(
    payload: bytes, *, transport: Transport, request_id: str = "", twin: str = ""
) -> Command | Setpoint:
    """Decode a twist, on ``T motion/command`` or on the bus channel ``commands/velocity``.

    The first has ``linear{x,y,z}`` and ``angular{z}``, the second ``linear_x`` to ``angular_z``; both are
    signed, body frame, m/s and rad/s. Roll and pitch rates are checked and not used. On the bus a sample may
    have Cyberwave's header; its stamp is used when the message has none, so that a replayed recording moves
    nothing. A message that names a stop is returned as that stop. Raises BadCommand.
    """
    try:
        message = sampled_object(payload) if transport is Transport.BUS else parse_object(payload)
        stop = stop_requested(message, transport)
        if stop is not None:
            return stop
        envelope = _envelope("motion", message, payload, transport, request_id, twin=twin)
        nested = not message.keys().isdisjoint(_TWIST)
        refuse_misspelt(message, _TWIST if nested else _FLAT_TWIST)
        return envelope.setpoint(_twist(message) if nested else _signed(message, ""))
    except WireError as error:
        raise BadCommand(error, command="motion") from None


def _usual(payload: bytes) -> _Usual | None:
    """Decode a message of the usual form; None for any other form, and for a malformed message."""
    try:
        read = _USUAL.decode(payload)
    except (ValueError, RecursionError):
        return None
    name = read.command
    if name not in _MEANINGS and not (name.isidentifier() and name.isascii() and name[0] != "_"):
        return None
    members = 4 + (read.session_id is not None) + len(read.data)
    # Each member has one colon. More colons mean an unknown member or a duplicate key: not the usual form.
    return read if payload.count(b":") == members else None


def _envelope(
    name: str, message: dict[str, object], payload: bytes, transport: Transport, request_id: str, *, twin: str
) -> _Envelope:
    """Read the fields that all commands share. A stop is never refused because of another field."""
    strict = not _is_stop(name, message)
    if strict:
        refuse_misspelt(message, _BODIES)
    origin, stamp = origin_and_stamp(message, transport, strict=strict, twin=twin)
    data = tolerant(_data, message, strict=strict)
    return _Envelope(name, data or {}, message, payload, request_id, origin, stamp)


def _is_stop(name: str, message: Mapping[str, object]) -> bool:
    """Return True for a stop, whatever the other fields of the message contain."""
    return name in STOP_WORDS or (name == "estop" and not releases(name, message.get("data")))


def _data(message: Mapping[str, object]) -> dict[str, object]:
    """Return the command's data; empty when it is missing or null."""
    return {} if message.get("data") is None else child(message, "data")


def _plain(envelope: _Envelope, _defaults: Defaults) -> Command:
    """Read a command whose data only the adapter interprets."""
    return envelope.command(envelope.name, envelope.data)


def _verb(envelope: _Envelope, defaults: Defaults) -> Command | Setpoint:
    """Read a motion verb: the verb fixes axis and sign, the data only gives the magnitude.

    A speed along any other axis is refused; ``move`` takes all axes.
    """
    verb = VERBS[envelope.name]
    refuse_unknown(envelope.data, _VERB_DATA, "data")
    given = {field: _magnitude(envelope.data, field) for field in VELOCITY_FIELDS}
    distance = _magnitude(envelope.data, "distance")
    own = given[verb.own_field]
    if own is None and distance is not None:
        return envelope.command(envelope.name, {"distance": abs(distance)})
    used = verb.own_field if own is not None else "linear_x"
    for field, value in given.items():
        if value and field != used:
            raise WireError(f"{envelope.name} has only {verb.own_field}; move has all", where=f"data.{field}")
    magnitude = given[used]
    if magnitude is None:
        magnitude = getattr(defaults(envelope.origin.session), verb.default)
    return envelope.setpoint(_along(verb.axis, verb.sign * abs(magnitude)))


def _magnitude(data: Mapping[str, object], field: str) -> float | None:
    """Return an optional magnitude; the error about a wrong one names its unit."""
    try:
        return optional_number(data, field, "data")
    except WireError as error:
        why = str(error).removeprefix(f"{error.where}: ")
        unit = _UNITS.get(field, "m/s")
        raise WireError(f"{why}; its unit is {unit}", where=error.where) from None


def _along(axis: Axis, value: float) -> Velocity:
    """Return a velocity along one axis only."""
    if axis == "yaw":
        return Velocity(yaw_rate=value)
    return Velocity(Vector3(**{axis: value}))


def _move(envelope: _Envelope, _defaults: Defaults) -> Setpoint:
    """Read ``move``, whose fields are signed."""
    velocity = _signed(envelope.data, "data")
    refuse_unknown(envelope.data, _VELOCITY, "data")
    return envelope.setpoint(velocity)


def _signed(members: Mapping[str, object], where: str) -> Velocity:
    """Return the velocity in flat signed fields, of which at least one must be present."""
    if _VELOCITY.isdisjoint(members):
        raise WireError(f"needs one of {', '.join(VELOCITY_FIELDS)}", where=where or "message")
    x = number(members, "linear_x", where) if "linear_x" in members else 0.0
    y = number(members, "linear_y", where) if "linear_y" in members else 0.0
    z = number(members, "linear_z", where) if "linear_z" in members else 0.0
    yaw_rate = number(members, "angular_z", where) if "angular_z" in members else 0.0
    return Velocity(Vector3(x, y, z), yaw_rate)


def _twist(message: Mapping[str, object]) -> Velocity:
    """Return the velocity of a ROS Twist; a missing axis is zero."""
    linear = _axes(message, "linear")
    return Velocity(linear, _axes(message, "angular").z)


def _axes(message: Mapping[str, object], name: str) -> Vector3:
    """Return one vector of a twist, zero when it is missing."""
    if name not in message:
        return Vector3()
    members = child(message, name)
    refuse_unknown(members, _AXES, name)
    return Vector3(*(optional_number(members, axis, name) or 0.0 for axis in "xyz"))


def _velocity_contract(envelope: _Envelope, _defaults: Defaults) -> Command | Setpoint:
    """Read a velocity contract, in ``velocity_command`` or in ``data``; a duration of 0 is a stop."""
    inside = "velocity_command" not in envelope.message
    body = envelope.data if inside else child(envelope.message, "velocity_command")
    velocity, lease = read_velocity_contract(body, where="data" if inside else "velocity_command")
    if lease == 0.0:
        return envelope.command("stop", {})
    return envelope.setpoint(velocity, lease)


def _setting(envelope: _Envelope, _defaults: Defaults) -> Command:
    """Read a default magnitude to store; its sign is ignored, as with the verbs."""
    field = SETTINGS[envelope.name]
    refuse_unknown(envelope.data, frozenset({field}), "data")
    return envelope.command(envelope.name, {field: abs(number(envelope.data, field, "data"))})


def _video(envelope: _Envelope, _defaults: Defaults) -> Command:
    """Read a start or stop of video. In the cloud a missing source type means an operator (contract 2.2).

    Older senders put ``recording`` and ``sensor_id`` beside ``data``.
    """
    beside: dict[str, object] = {
        name: envelope.message[name] for name in ("recording", "sensor_id") if name in envelope.message
    }
    requested = envelope.command(envelope.name, {**beside, **envelope.data})
    if requested.origin.transport is not Transport.CLOUD or requested.origin.source_type is not None:
        return requested
    return msgspec.structs.replace(
        requested, origin=msgspec.structs.replace(requested.origin, source_type="tele")
    )


def _estop(envelope: _Envelope, _defaults: Defaults) -> Command:
    """Read the emergency switch of ground robots."""
    if releases("estop", envelope.data):
        return envelope.command("release_emergency_stop", {})
    return envelope.command(EMERGENCY, envelope.data)


_MEANINGS: Mapping[str, Callable[[_Envelope, Defaults], Command | Setpoint]] = MappingProxyType(
    {
        **dict.fromkeys(VERBS, _verb),
        "move": _move,
        "velocity_command": _velocity_contract,
        "locomotion_velocity": _velocity_contract,
        **dict.fromkeys(SETTINGS, _setting),
        **dict.fromkeys(VIDEO_TYPES, _video),
        "estop": _estop,
    }
)
VELOCITY_WORDS = frozenset(_MEANINGS) - {"estop", *SETTINGS, *VIDEO_TYPES}
"""Commands that set a velocity, as part of a stream, and not a discrete request."""
