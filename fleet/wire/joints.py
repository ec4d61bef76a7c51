"""Decoder of inbound ``J update``: joint targets, in every form that the SDK and the reference send.

| form | fields |
|---|---|
| targets | ``target_positions``, ``target_velocities``, ``target_efforts`` |
| aggregated | ``positions``, ``velocities``, ``efforts`` |
| single | ``type: joint_state``, ``joint_name``, ``joint_state {position, velocity, effort}`` |
| flat | every other number at the top level is a joint's position |
| bus | ``names`` and ``positions`` as arrays of one length, on ``commands/joint_positions`` alone |

All forms but the first also carry measured joints. A message without targets from a sender of state
(``edge``, ``sim``) is no request. State of an ``edge_leader`` is one: its follower is to go there, unless
the robot is itself a leader and this is its own state. The result is a setpoint of positions. Velocities and
efforts beside a position are checked and not used, because the joint's declared limits bound its speed;
without a position they are refused. ``update_mode`` is ``absolute``, or ``relative`` to the current position.
"""

from __future__ import annotations

from collections.abc import Mapping

from fleet.errors import WireError
from fleet.model.command import Command, JointSetpoint, Transport
from fleet.wire.envelope import (
    BadCommand,
    identity,
    optional_word,
    origin_and_stamp,
    sampled_object,
    stop_requested,
)
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.strict_json import child, finite, parse_object, path, text

JOINT_TARGETS = "joint_targets"
MOST_JOINTS = 256
STATE_SENDERS = frozenset({"edge", "edge_leader", "edge_follower", "sim"})
LEADER = "edge_leader"
_MODES = ("absolute", "relative")
_SETS = ("positions", "velocities", "efforts")
_SINGLE = {"position": "positions", "velocity": "velocities", "effort": "efforts"}
NEVER_JOINTS = frozenset(
    {
        "source_type",
        "source_subtype",
        "workload_uuid",
        "session_id",
        "controller_session_uuid",
        "timestamp",
        "ts",
        "ts_raw",
        "ts_norm",
        "ts_unix",
        "ts_us",
        "type",
        "mqtt_topic",
        "twin_uuid",
        "camera_frame_counters",
        "stream_instance_id",
        "applied_position_targets",
        "mode",
        "update_mode",
        "joint_name",
        "joint_state",
        *_SETS,
        *(f"target_{name}" for name in _SETS),
    }
)

_SET_FIELDS = frozenset({"mode", "update_mode", *_SETS, *(f"target_{name}" for name in _SETS)})

Sets = dict[str, dict[str, float]]


def decode_joints(
    payload: bytes, *, transport: Transport, request_id: str = "", twin: str = "", leads: bool = False
) -> JointSetpoint | Command | None:
    """Return the joint targets in a message; None for measured joints.

    ``leads``: the robot is a leader, so the state of a leader is its own. On the bus a sample may have
    Cyberwave's header; its stamp is used when the message has none. A message that names a stop is returned
    as that stop. Raises BadCommand, with the name of the command.
    """
    try:
        message = sampled_object(payload) if transport is Transport.BUS else parse_object(payload)
        stop = stop_requested(message, transport)
        if stop is not None:
            return stop
        origin, stamp = origin_and_stamp(message, transport, strict=True, twin=twin)
        sets = _named_sets(message, "target_")
        measures = origin.source_type in STATE_SENDERS and not (origin.source_type == LEADER and not leads)
        if not sets and measures:
            return None
        sets = sets or _measured_form(message, arrays=transport is Transport.BUS)
        positions, relative = _positions(sets), _is_relative(message)
    except WireError as error:
        raise BadCommand(error, command=JOINT_TARGETS) from None
    same = identity(payload, stamp, request_id, positions) if relative else ""
    return JointSetpoint(positions, relative, JOINT_TARGETS, origin, stamp, same)


def _positions(sets: Sets) -> dict[str, float]:
    """Return the target positions; raises WireError for a joint with only a velocity or an effort."""
    positions = sets.get("positions", {})
    for name in ("velocities", "efforts"):
        for joint in sets.get(name, {}):
            if joint not in positions:
                raise WireError("a joint is led by its position; give that as well", where=path(name, joint))
    return positions


def _is_relative(message: Mapping[str, object]) -> bool:
    """Return True when positions are relative to the current ones; raises WireError for an unknown mode."""
    field = "update_mode" if "update_mode" in message else "mode"
    mode = optional_word(message, field)
    if mode and mode not in _MODES:
        raise WireError(f"one of {', '.join(_MODES)} is needed, not {mode!a}", where=field)
    return mode == "relative"


def _measured_form(message: Mapping[str, object], *, arrays: bool) -> Sets:
    """Read the forms that measured joints share; raises WireError when no joint is named."""
    if arrays and "names" in message:
        found = _arrays(message)
    else:
        found = _single(message) if "joint_name" in message else _named_sets(message, "") or _flat(message)
    if not found:
        raise WireError("no joint is named")
    return found


def _named_sets(message: Mapping[str, object], prefix: str) -> Sets:
    """Read the sets that are present, each with a number per joint."""
    found = {name: child(message, prefix + name) for name in _SETS if prefix + name in message}
    if found:
        refuse_misspelt(message, _SET_FIELDS)
    return {name: _numbers(values, prefix + name) for name, values in found.items() if values}


def _single(message: Mapping[str, object]) -> Sets:
    """Read the state of one joint."""
    name, state = text(message, "joint_name"), child(message, "joint_state")
    given = {field: finite(state[field], path("joint_state", field)) for field in _SINGLE if field in state}
    return {_SINGLE[field]: {name: value} for field, value in given.items()}


def _arrays(message: Mapping[str, object]) -> Sets:
    """Read the form of the bus; raises WireError for arrays that do not match."""
    names, values = message["names"], message.get("positions")
    if not (isinstance(names, list) and isinstance(values, list) and len(names) == len(values)):
        raise WireError("two arrays of one length are needed", where="names, positions")
    if not all(isinstance(name, str) for name in names) or len(set(names)) != len(names):
        raise WireError("each joint must be named once, by text", where="names")
    return {"positions": _numbers(dict(zip(names, values, strict=True)), "positions")} if names else {}


def _flat(message: Mapping[str, object]) -> Sets:
    """Read every number at the top level that is not an envelope field."""
    joints = {name: value for name, value in message.items() if name not in NEVER_JOINTS}
    return {"positions": _numbers(joints, "")} if joints else {}


def _numbers(values: Mapping[str, object], where: str) -> dict[str, float]:
    """Return the numbers of a set; raises WireError for anything else in it."""
    if len(values) > MOST_JOINTS:
        raise WireError(f"{len(values)} joints are more than {MOST_JOINTS}", where=where)
    return {name: finite(value, path(where, name)) for name, value in values.items()}
