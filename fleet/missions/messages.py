"""What a run sends its robots: the same messages that anybody sends, in the name of who started it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from fleet.errors import Refused
from fleet.missions.program import Act
from fleet.model.geometry import Vector3
from fleet.model.state import RobotState
from fleet.wire.missions import EXECUTION
from fleet.wire.rules import Kind

Places = Mapping[str, Sequence[float]]
"""Places by name: x, y and perhaps z, metres in the site's frame."""


def message_of(act: Act, identity: str, robot: RobotState, places: Places) -> tuple[Kind, dict[str, Any]]:
    """Return the kind of a message and what it says, but for its sender and stamp; raises Refused."""
    if act.verb == "command":
        return "command", {"command": act.value, "data": act.data}
    if act.verb == "plan":
        return "mission", {"command": "start", EXECUTION: identity, "mission": act.value}
    message: dict[str, Any] = {"command": act.verb, "action_id": identity}
    if act.speed is not None:
        message["constraints"] = {"max_speed_ms": act.speed}
    if act.verb == "goto":
        return "navigate", message | {"position": _position(act.value, robot, places)}
    return "navigate", message | {
        "waypoints": [{"position": _position(each, robot, places)} for each in act.value]
    }


def _position(value: Any, robot: RobotState, places: Places) -> list[float]:
    """Return a point of the site's frame in the robot's own world; a height that is not given is its own."""
    point = places.get(value) if isinstance(value, str) else value
    if point is None:
        raise Refused(f"there is no place {value!r}")
    if robot.placement is None:
        raise Refused(f"{robot.name} is not placed in the site's frame: site: and start: in fleet.yaml")
    here = robot.site.z if robot.site is not None else 0.0
    x, y, z = (*point, here) if len(point) == 2 else point
    world = robot.placement.to_world(Vector3(x, y, z))
    return [world.x, world.y, world.z][: len(point) if robot.armed is None else 3]


def payload_of(message: Mapping[str, Any], *, session: str, source_type: str | None, now: float) -> bytes:
    """Return a message that is sent now (Unix s) in the name of who started the run."""
    sender: dict[str, Any] = {"session_id": session, "timestamp": now}
    if source_type is not None:
        sender["source_type"] = source_type
    return msgspec.json.encode({**message, **sender})
