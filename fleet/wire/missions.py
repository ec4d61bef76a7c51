"""``T mission/command``: no robot here flies the cloud's missions, and whoever sends one is told so.

Only ``cancel`` is carried out: somebody wants the robot to end what it does, so it stops.
"""

from __future__ import annotations

from fleet.errors import WireError
from fleet.model.command import Reply, Way
from fleet.model.navigation import Control, Navigate
from fleet.wire.encoding import encode_finite
from fleet.wire.envelope import BadCommand, name_of, origin_and_stamp
from fleet.wire.strict import parse_object

EXECUTION = "mission_execution_uuid"


def decode_mission(payload: bytes, *, way: Way) -> Navigate:
    """Return the stop that a cancelled mission is; raises BadCommand, with the reason, for anything else."""
    name = ""
    try:
        message = parse_object(payload)
        name = name_of(message)
        _refuse_all_but_cancel(name)
        origin, stamp = origin_and_stamp(message, way, strict=False)
    except WireError as error:
        raise BadCommand(error, command=name or "mission") from None
    return Navigate(Control.STOP, "", origin, stamp)


def _refuse_all_but_cancel(name: str) -> None:
    """Say what a mission's sender can do instead."""
    if name != "cancel":
        raise WireError("this edge flies no missions; send the goals as a path on navigate/command")


def mission_status(payload: bytes, reply: Reply, *, source_type: str, stamp: float) -> bytes | None:
    """Return what ``mission/status`` says to a mission command; None when it names no mission."""
    try:
        execution = parse_object(payload).get(EXECUTION)
    except WireError:
        return None
    if not isinstance(execution, str) or not execution:
        return None
    message = {
        EXECUTION: execution,
        "status": "cancelled" if reply.ok else "failed",
        "current_step": 0,
        "message": reply.reason,
        "source_type": source_type,
        "timestamp": stamp,
    }
    return encode_finite(message)
