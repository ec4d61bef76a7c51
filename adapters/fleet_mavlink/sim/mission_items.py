"""Plan items on the wire, and the autopilots' variants of the mission protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mav

FENCE = int(mav.MAV_MISSION_TYPE_FENCE)
MISSION = int(mav.MAV_MISSION_TYPE_MISSION)
_FLOWN = frozenset({16, 17, 19, 20, 21, 22, 31, 82, 93})  # navigation commands of both autopilots
LOITER_TURNS = 18  # PX4 lacks this item


class Item(NamedTuple):
    """One mission item; x and y are degrees times 1e7."""

    frame: int
    command: int
    autocontinue: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: int
    y: int
    z: float


@dataclass(frozen=True, slots=True)
class MissionBehaviour:
    """One autopilot's variant of the mission protocol."""

    request: Callable[[int, int, int, int], Any]
    repeat: float  # seconds after which a request is repeated
    home_is_first: bool
    tells_duplicates: bool
    keeps_place: bool  # a mission that replaces a started one continues at its current number
    frames_reported: Mapping[int, int]  # frames that are returned as another one
    reached_times: int = 1  # reports of a reached item, a second apart
    flies: frozenset[int] = _FLOWN


ARDUPILOT_BEHAVIOUR = MissionBehaviour(
    mav.MAVLink_mission_request_message,
    1.0,
    home_is_first=True,
    tells_duplicates=True,
    keeps_place=True,
    frames_reported={5: 0, 6: 3},
    flies=_FLOWN | {LOITER_TURNS},
)
PX4_BEHAVIOUR = MissionBehaviour(
    mav.MAVLink_mission_request_int_message,
    0.25,
    home_is_first=False,
    tells_duplicates=False,
    keeps_place=False,
    frames_reported={},
    reached_times=11,
)


def item_of(message: Any) -> Item:
    """Return the item in MISSION_ITEM_INT, or in MISSION_ITEM, whose x and y are degrees."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        x, y = int(x * 1e7), int(y * 1e7)
    params = (message.param1, message.param2, message.param3, message.param4)
    return Item(message.frame, message.command, message.autocontinue, *params, x, y, message.z)
