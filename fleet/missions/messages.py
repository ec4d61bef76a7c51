"""Messages from a run to its robots, in the same formats as from any sender."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from fleet.missions.plan import items_of
from fleet.missions.points import SiteMap
from fleet.missions.program import Act
from fleet.model.state import RobotState
from fleet.wire.missions import EXECUTION
from fleet.wire.rules import Kind


def message_of(act: Act, identity: str, robot: RobotState, site: SiteMap) -> tuple[Kind, dict[str, Any]]:
    """Return the kind and content of the message for an act, without sender and stamp; raises Refused."""
    if act.verb == "command":
        return "command", {"command": act.value, "data": act.data}
    if act.verb == "plan":
        return "mission", {"command": "start", EXECUTION: identity, "mission": items_of(act.value)}
    message: dict[str, Any] = {"command": act.verb, "action_id": identity}
    if act.speed is not None:
        message["constraints"] = {"max_speed_ms": act.speed}
    if act.verb == "follow":
        return "navigate", message | {"robot": act.value, **act.data}
    if act.verb == "goto":
        return "navigate", message | site.position(act.value, robot)
    return "navigate", message | {"waypoints": [site.position(each, robot) for each in act.value]}


def payload_of(message: Mapping[str, Any], *, session: str, source_type: str | None, now: float) -> bytes:
    """Encode a message sent now (Unix s) in the name of the user who started the run."""
    sender: dict[str, Any] = {"session_id": session, "timestamp": now}
    if source_type is not None:
        sender["source_type"] = source_type
    return msgspec.json.encode({**message, **sender})
