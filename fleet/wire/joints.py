"""``J update`` inward: joint targets, in every form that the SDK and the reference send.

| form | fields |
|---|---|
| targets | ``target_positions``, ``target_velocities``, ``target_efforts`` |
| aggregated | ``positions``, ``velocities``, ``efforts`` |
| single | ``type: joint_state``, ``joint_name``, ``joint_state {position, velocity, effort}`` |
| flat | every other number at the top level is a joint's position |

The last three are also how joints are measured. A sender of state (``edge``, ``sim``) that sets no target
asks nothing. What remains is the command ``joint_targets`` with ``positions``, ``velocities``, ``efforts``
and ``mode``; a robot obeys it when its adapter declares that command.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fleet.errors import WireError
from fleet.model.command import Command, Transport
from fleet.wire.envelope import BadCommand, identity, optional_word, origin_and_stamp, stop_asked
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.strict import child, finite, parse_object, path, text

JOINT_TARGETS = "joint_targets"
MOST_JOINTS = 256
STATE_SENDERS = frozenset({"edge", "edge_leader", "edge_follower", "sim"})
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


def decode_joints(payload: bytes, *, way: Transport, request_id: str = "", twin: str = "") -> Command | None:
    """Return the joint targets in a message, as a command; None for joints that somebody measured.

    A message that names a stop is that stop.

    Raises BadCommand, which names the command.
    """
    try:
        message = parse_object(payload)
        stop = stop_asked(message, way)
        if stop is not None:
            return stop
        origin, stamp = origin_and_stamp(message, way, strict=True, twin=twin)
        targets = _named_sets(message, "target_")
        if not targets and origin.source_type in STATE_SENDERS:
            return None
        data: dict[str, Any] = {**(targets or _measured_form(message))}
        mode = optional_word(message, "update_mode") or optional_word(message, "mode")
        if mode:
            data["mode"] = mode
    except WireError as error:
        raise BadCommand(error, command=JOINT_TARGETS) from None
    same = identity(payload, stamp, request_id, data)
    return Command(JOINT_TARGETS, data, origin, same, stamp)


def _measured_form(message: Mapping[str, Any]) -> Sets:
    """Read the three forms in which joints are measured, too; raises WireError when no joint is named."""
    found = _single(message) if "joint_name" in message else _named_sets(message, "") or _flat(message)
    if not found:
        raise WireError("no joint is named")
    return found


def _named_sets(message: Mapping[str, Any], prefix: str) -> Sets:
    """Read the sets that are there, each a number for each joint."""
    found = {name: child(message, prefix + name) for name in _SETS if prefix + name in message}
    if found:
        refuse_misspelt(message, _SET_FIELDS)
    return {name: _numbers(values, prefix + name) for name, values in found.items() if values}


def _single(message: Mapping[str, Any]) -> Sets:
    """Read the state of one joint."""
    name, state = text(message, "joint_name"), child(message, "joint_state")
    given = {field: finite(state[field], path("joint_state", field)) for field in _SINGLE if field in state}
    return {_SINGLE[field]: {name: value} for field, value in given.items()}


def _flat(message: Mapping[str, Any]) -> Sets:
    """Read every number at the top level that is none of the envelope's."""
    joints = {name: value for name, value in message.items() if name not in NEVER_JOINTS}
    return {"positions": _numbers(joints, "")} if joints else {}


def _numbers(values: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the numbers of a set; raises WireError for anything else in it."""
    if len(values) > MOST_JOINTS:
        raise WireError(f"{len(values)} joints are more than {MOST_JOINTS}", where=where)
    return {name: finite(value, path(where, name)) for name, value in values.items()}
