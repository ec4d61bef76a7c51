"""Decoder of ``T navigate/command``: goals and controls, in both vocabularies that are in use.

The reference uses ``navigate_to_pose`` and ``cancel``, the SDK ``goto``, ``path``, ``relative_move``,
``stop``, ``pause`` and ``resume``; ``follow`` is this project's own. A heading is taken from ``yaw``, else
from a rotation's named components, else from a list, whose order is that of the vocabulary unless the robot's
configuration sets one. A request that cannot be carried out as meant (another frame than the world, actions
at a goal) is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

import msgspec

from fleet.errors import WireError
from fleet.model.command import Command, Transport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3, enu_yaw_from_heading, wrap_angle
from fleet.model.navigation import (
    AnyTask,
    Constraints,
    Control,
    FollowPath,
    FollowRobot,
    Goal,
    GoTo,
    Navigate,
    RelativeMove,
)
from fleet.wire.envelope import (
    BadCommand,
    identity,
    name_of,
    optional_word,
    origin_and_stamp,
    stop_requested,
    tolerant,
)
from fleet.wire.measures import not_negative, positive, within
from fleet.wire.rotation import QuaternionOrder, yaw_of
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.stops import STOP_WORDS, is_reply
from fleet.wire.strict_json import child, finite, kind, number, parse_object, path, read_loosely, text, whole
from fleet.wire.strict_json import without_nulls as given

MOST_WAYPOINTS = 500
MOST_LOOPS = 1000
LONGEST_WAIT = 3600.0  # s
NEAREST, FARTHEST = 0.5, 100.0  # m that one robot may be led behind another
WORLD_FRAMES = frozenset({"map", "odom", "world"})

CONTROLS: Mapping[str, Control] = MappingProxyType(
    {
        "stop": Control.STOP,
        "cancel": Control.STOP,
        "hover": Control.STOP,
        "pause": Control.PAUSE,
        "resume": Control.RESUME,
    }
)

_PLACE = frozenset(
    {
        "position",
        "geodetic_position",
        "coordinate_frame",
        "yaw",
        "rotation",
        "orientation",
        "actions",
        "metadata",
        "duration_seconds",
    }
)
_FIELDS: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "": _PLACE
        | {"waypoints", "constraints", "relative_translation", "frame", "frame_id", "reference_frame"}
        | {"action_id", "robot", "distance_m"},
        "waypoint": _PLACE | {"id", "x", "y", "z"},
        "geodetic_position": frozenset({"latitude", "longitude", "altitude"}),
        "constraints": frozenset({"max_speed_ms", "goal_tolerance_m"}),
        "metadata": frozenset({"wait_s", "max_loops", "units"}),
    }
)
"""Known fields of each object; an unknown field whose name resembles one of them is refused."""


class _MessageConventions(msgspec.Struct, frozen=True):
    """Conventions for one message, from the robot's configuration and the vocabulary."""

    order: QuaternionOrder
    planar: bool
    home_altitude: float | None
    origin_heading: float


def decode_navigate(
    payload: bytes,
    *,
    transport: Transport,
    request_id: str = "",
    rotation_order: Literal["auto", "wxyz", "xyzw"],
    planar: bool = False,
    home_altitude: float | None = None,
    origin_heading: float = 0.0,
    twin: str = "",
) -> Navigate | Command | None:
    """Return the goal or control in a message; None for a status that was published on this topic.

    A stop that only the command topic defines, such as an emergency stop, is returned as that command.

    A task without an action id gets one derived from the message or from ``request_id`` (the sender's own
    id), so that a repeat of it does not move the robot a second time.
    ``twin``: the twin of the topic; a message that names another one is refused.
    ``planar``: the robot cannot tilt, so a tilted rotation is a mistake. ``home_altitude`` (m AMSL): altitude
    of the take-off point, to which geodetic altitudes are relative; without it they are refused.
    ``origin_heading`` (compass degrees of the world's +y) converts compass headings to world yaw.
    Raises BadCommand, with the name and the action id where they could be read.
    """
    name = action_id = ""
    try:
        message = given(parse_object(payload))
        if is_reply(message):
            return None
        name = name_of(message)
        if name in STOP_WORDS and name not in CONTROLS:
            return stop_requested(message, transport)
        stops = CONTROLS.get(name) is Control.STOP
        action_id = tolerant(optional_word, message, "action_id", strict=not stops) or ""
        origin, stamp = origin_and_stamp(message, transport, strict=not stops, twin=twin)
        order = _order(name, rotation_order)
        reading = _MessageConventions(order, planar, home_altitude, origin_heading)
        request = CONTROLS.get(name) or _task(name, message, reading)
        if not isinstance(request, Control):
            action_id = action_id or identity(payload, stamp, request_id, request)
    except WireError as error:
        action_id = action_id or read_loosely(payload, "action_id")
        raise BadCommand(error, command=name, action_id=action_id) from None
    return Navigate(request, action_id, origin, stamp)


def _order(name: str, configured: Literal["auto", "wxyz", "xyzw"]) -> QuaternionOrder:
    """Return the component order of list rotations: the configured one, else that of the vocabulary."""
    if configured != "auto":
        return configured
    return "xyzw" if name == "navigate_to_pose" else "wxyz"


def _task(name: str, message: Mapping[str, object], reading: _MessageConventions) -> AnyTask:
    """Read a task; raises WireError for an unknown name."""
    read = TASKS.get(name)
    if read is None:
        known = ", ".join([*TASKS, *CONTROLS])
        raise WireError(f"{name!a} is not navigation ({known}); send it as a command", where="command")
    refuse_misspelt(message, _FIELDS[""])
    _refuse_foreign_frames(message)
    return read(message, reading)


def _refuse_foreign_frames(message: Mapping[str, object]) -> None:
    """Raise WireError for coordinates in any other frame than the world."""
    for name in ("reference_frame", "frame_id"):
        frame = optional_word(message, name)
        if frame and frame not in WORLD_FRAMES:
            known = ", ".join(sorted(WORLD_FRAMES))
            raise WireError(f"{frame[:40]!a} is not a frame of the world ({known})", where=name)


def _goto(message: Mapping[str, object], reading: _MessageConventions) -> AnyTask:
    """Read one goal, or a path when the message has waypoints."""
    if message.get("waypoints"):
        return _path(message, reading)
    return GoTo(_goal(message, "", reading, _wait(message, "")), _constraints(message))


def _path(message: Mapping[str, object], reading: _MessageConventions) -> AnyTask:
    """Read a path; a position beside the waypoints is its last goal."""
    waypoints = message.get("waypoints")
    if not isinstance(waypoints, list) or not 1 <= len(waypoints) <= MOST_WAYPOINTS:
        raise WireError(f"an array of 1 to {MOST_WAYPOINTS} is needed", where="waypoints")
    wait = _wait(message, "")
    shared = {name: message[name] for name in ("coordinate_frame", "yaw") if name in message}
    goals = [_waypoint(item, f"waypoints.{at}", reading, wait, shared) for at, item in enumerate(waypoints)]
    if "position" in message or "geodetic_position" in message:
        goals.append(_goal(message, "", reading, wait))
    return FollowPath(tuple(goals), _loops(message), _constraints(message))


def _waypoint(
    item: object, where: str, reading: _MessageConventions, wait: float, shared: Mapping[str, object]
) -> Goal:
    """Read one waypoint: an object with a position, or its components, or a plain list.

    ``shared`` holds the fields that the message sets for all waypoints. ``duration_seconds`` is for
    controllers that plan trajectories; here ``constraints`` limits the speed, so it is checked and not used.
    """
    if isinstance(item, list):
        item = {"position": item}
    if not isinstance(item, dict):
        raise WireError(f"a waypoint is needed, this is {kind(item)}", where=where)
    members = given(item)
    if "position" not in members and {"x", "y"} <= members.keys():
        members["position"] = {axis: members[axis] for axis in "xyz" if axis in members}
    refuse_misspelt(members, _FIELDS["waypoint"], where)
    turned = members.keys() & {"yaw", "rotation", "orientation"}
    inherited = {name: value for name, value in shared.items() if name != "yaw" or not turned}
    not_negative(members, "duration_seconds", where)
    return _goal({**inherited, **members}, where, reading, _wait(members, where) or wait)


def _goal(members: Mapping[str, object], where: str, reading: _MessageConventions, wait: float) -> Goal:
    """Read the position and heading of a goal."""
    if members.get("actions"):
        raise WireError("nothing can be done at a goal but wait", where=path(where, "actions"))
    flat, geo = "position" in members, "geodetic_position" in members
    if flat == geo:
        raise WireError("either position or geodetic_position is needed", where=where or "message")
    _refuse_other_kind(members, where, "geodetic" if geo else "cartesian")
    if geo:
        point = _geodetic(members, where, reading)
        return Goal(geo=point, yaw=_heading(members, where, reading), wait=wait)
    position = _vector(members["position"], path(where, "position"), planar=reading.planar)
    return Goal(position, yaw=_yaw(members, where, reading), wait=wait)


def _refuse_other_kind(members: Mapping[str, object], where: str, expected: str) -> None:
    """Raise WireError for a position that contradicts its coordinate frame."""
    if "coordinate_frame" not in members:
        return
    frame = child(members, "coordinate_frame", where)
    if text(frame, "kind", path(where, "coordinate_frame")) != expected:
        raise WireError(f"kind must be {expected} for this position", where=path(where, "coordinate_frame"))


def _vector(value: object, where: str, *, planar: bool = False) -> Vector3:
    """Read [x, y, z] or {x, y, z} in metres; z is optional for a planar robot."""
    if isinstance(value, dict):
        names = [axis for axis in "xyz" if axis != "z" or not planar or value.get("z") is not None]
        return Vector3(*(number(value, axis, where) for axis in names))
    if not isinstance(value, list) or not (2 if planar else 3) <= len(value) <= 3:
        raise WireError("three numbers x, y, z are needed", where=where)
    return Vector3(*_numbers(value, where))


def _numbers(values: Sequence[object], where: str) -> list[float]:
    """Return finite numbers; raises WireError with the path of the first other value."""
    return [finite(value, f"{where}.{index}") for index, value in enumerate(values)]


def _yaw(members: Mapping[str, object], where: str, reading: _MessageConventions) -> float | None:
    """Return the world yaw (radians) of a cartesian goal, None when it is left to the robot."""
    if "yaw" in members:
        return wrap_angle(number(members, "yaw", where))
    if "rotation" in members:
        place = path(where, "rotation")
        return yaw_of(members["rotation"], order=reading.order, planar=reading.planar, where=place)
    return _heading(members, where, reading)


def _heading(members: Mapping[str, object], where: str, reading: _MessageConventions) -> float | None:
    """Return the world yaw (radians) for a compass heading (``orientation.heading``, degrees), or None."""
    if "geodetic_position" in members and members.keys() & {"yaw", "rotation"}:
        raise WireError("a geodetic goal is turned by orientation.heading", where=where or "message")
    if "orientation" not in members:
        return None
    heading = number(child(members, "orientation", where), "heading", path(where, "orientation"))
    return wrap_angle(enu_yaw_from_heading(math.radians(heading - reading.origin_heading)))


def _geodetic(members: Mapping[str, object], where: str, reading: _MessageConventions) -> GeoPoint:
    """Read a position on Earth; the returned altitude is AMSL."""
    place = path(where, "geodetic_position")
    point = given(child(members, "geodetic_position", where))
    refuse_misspelt(point, _FIELDS["geodetic_position"], place)
    latitude = within(point, "latitude", place, 90.0)
    longitude = within(point, "longitude", place, 180.0)
    if reading.planar and "altitude" not in point:
        return GeoPoint(latitude, longitude, reading.home_altitude or 0.0)
    datum = _datum(members, path(place, "altitude"), reading)
    return GeoPoint(latitude, longitude, datum + number(point, "altitude", place))


def _datum(members: Mapping[str, Any], where: str, reading: _MessageConventions) -> float:
    """Return the datum (m AMSL) of a geodetic altitude: the take-off point, unless it says amsl."""
    reference = members.get("coordinate_frame", {}).get("altitude_reference") or "relative_to_takeoff"
    if reference == "amsl":
        return 0.0
    if reference != "relative_to_takeoff":
        raise WireError(f"counts from {str(reference)[:40]!a}, which is not understood", where=where)
    if reading.home_altitude is None:
        raise WireError("counts from the take-off point, whose altitude is unknown", where=where)
    return reading.home_altitude


def _relative(message: Mapping[str, object], _reading: _MessageConventions) -> AnyTask:
    """Read a relative move, in metres, in the robot's frame or the world's."""
    if "relative_translation" not in message:
        raise WireError("is missing", where="relative_translation")
    frame = text(message, "frame")
    if frame not in {"body", "world"}:
        raise WireError(f"body or world is needed, not {frame[:40]!a}", where="frame")
    units = _metadata(message, "").get("units", "meters")
    if units != "meters":
        raise WireError("only meters are understood", where="metadata.units")
    translation = _vector(message["relative_translation"], "relative_translation")
    return RelativeMove(translation, frame == "body", _constraints(message))


def _follow(message: Mapping[str, object], _reading: _MessageConventions) -> AnyTask:
    """Read which robot of the edge is followed, and how near."""
    distance = number(message, "distance_m")
    if not NEAREST <= distance <= FARTHEST:
        raise WireError(f"{NEAREST:g} to {FARTHEST:g} m is needed, not {distance}", where="distance_m")
    return FollowRobot(text(message, "robot"), distance, _constraints(message))


def _constraints(message: Mapping[str, object]) -> Constraints:
    """Read the limits that the sender sets; a missing one leaves the robot's own limit."""
    if "constraints" not in message:
        return Constraints()
    members = given(child(message, "constraints"))
    refuse_misspelt(members, _FIELDS["constraints"], "constraints")
    return Constraints(
        positive(members, "max_speed_ms", "constraints"), positive(members, "goal_tolerance_m", "constraints")
    )


def _metadata(members: Mapping[str, object], where: str) -> dict[str, object]:
    """Return the metadata, empty when it is missing."""
    metadata = given(child(members, "metadata", where)) if "metadata" in members else {}
    refuse_misspelt(metadata, _FIELDS["metadata"], path(where, "metadata"))
    return metadata


def _wait(members: Mapping[str, object], where: str) -> float:
    """Return the time to stay at a goal, seconds."""
    place = path(where, "metadata")
    wait = not_negative(_metadata(members, where), "wait_s", place) or 0.0
    if wait > LONGEST_WAIT:
        raise WireError(f"at most {LONGEST_WAIT:g} s are waited, not {wait}", where=path(place, "wait_s"))
    return wait


def _loops(message: Mapping[str, object]) -> int:
    """Return the number of times to follow a path."""
    metadata = {"max_loops": 1, **_metadata(message, "")}
    loops = whole(metadata, "max_loops", "metadata")
    if not 1 <= loops <= MOST_LOOPS:
        raise WireError(f"1 to {MOST_LOOPS} is possible, not {loops}", where="metadata.max_loops")
    return loops


TASKS: Mapping[str, Callable[[Mapping[str, object], _MessageConventions], AnyTask]] = MappingProxyType(
    {
        "goto": _goto,
        "navigate_to_pose": _goto,
        "path": _path,
        "relative_move": _relative,
        "follow": _follow,
    }
)
