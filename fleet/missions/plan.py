"""Conversion of QGroundControl's .plan files to ``aerial.mission.v1``.

Source: QGroundControl's plan file format 1 (``fileType: Plan``). Complex items such as surveys contain the
simple items that they consist of; these are used. Altitudes above terrain, geofences and rally points are not
supported: a file that needs them is refused, so that only the planned mission is flown.

The file names the autopilot and the kind of vehicle for which it was made (``firmwareType``,
``vehicleType``). They are kept beside its items as ``made_for``, so that no other kind flies it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from fleet.errors import WireError
from fleet.runtime.decoding import decode_json
from fleet.wire.missions import CONTRACT, plan_of

_GLOBAL, _ABOVE_HOME = 0, 3  # MAV_FRAME
_MISSION_FRAME = 2
TAKEOFF, LAND = 22, 21
_VTOL_TAKEOFF, _VTOL_LAND = 84, 85
_TAKEOFFS = frozenset({TAKEOFF, _VTOL_TAKEOFF})
_LANDING_PATTERNS = frozenset({"fwLandingPattern", "vtolLandingPattern"})
_SPEED = 178  # MAV_CMD_DO_CHANGE_SPEED
_Params = list[Any]


def _seconds(params: _Params) -> dict[str, Any]:
    """Return the time of a loiter."""
    return {"seconds": params[0]}


def _turns(params: _Params) -> dict[str, Any]:
    """Return the turns of a loiter."""
    return {"turns": int(params[0] or 1), "radius_m": abs(params[2] or 0), "direction": _direction(params[2])}


def _until_high(params: _Params) -> dict[str, Any]:
    """Return the circle of a climb or descent in circles."""
    return {"radius_m": abs(params[1] or 0), "direction": _direction(params[1])}


def _direction(radius: float | None) -> str:
    """Return the direction of rotation; a negative radius is counter-clockwise."""
    return "ccw" if (radius or 0) < 0 else "cw"


_ITEMS: Mapping[int, tuple[str, Callable[[_Params], dict[str, Any]]]] = MappingProxyType(
    {
        16: ("waypoint", lambda _: {}),
        17: ("loiter_unlimited", lambda _: {}),
        18: ("loiter_turns", _turns),
        19: ("loiter_time", _seconds),
        20: ("return_to_launch", lambda _: {}),
        LAND: ("land", lambda _: {}),
        _VTOL_LAND: ("land", lambda _: {}),
        31: ("loiter_to_altitude", _until_high),
        189: ("land_start", lambda _: {}),
    }
)


_AUTOPILOTS = MappingProxyType({3: "ardupilot", 12: "px4"})  # MAV_AUTOPILOT
_VEHICLES = MappingProxyType(  # MAV_TYPE
    {
        **dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), "multirotor"),
        **dict.fromkeys(range(19, 26), "vtol"),
        1: "plane",
        7: "airship",
        10: "rover",
        11: "boat",
        12: "submarine",
    }
)
_ANY = 0  # MAV_AUTOPILOT_GENERIC, MAV_TYPE_GENERIC
_CLASSES = MappingProxyType(  # from the terms in which robots report their own kind
    {
        "fixed_wing": "plane",
        "ground_rover": "rover",
        "surface_boat": "boat",
        "coaxial": "multirotor",
        "helicopter": "multirotor",
        "tricopter": "multirotor",
    }
)
_KINDS = (frozenset(_AUTOPILOTS.values()), frozenset(_VEHICLES.values()))
MADE_FOR = "made_for"
"""Key of a plan for the autopilot and kind of vehicle for which it was made."""
_FOR = "plan for "
PLAN = "plan"

PILOT = "pilot"
"""Role of the aircraft that flies a plan."""


def mission_of_plan(plan: Mapping[str, Any], summary: str) -> dict[str, Any]:
    """Return the data of a one-step mission in which one aircraft flies a plan from its memory."""
    return {
        "version": 1,
        "summary": summary[:200],
        "roles": {PILOT: {"can": ["plan"]}},
        "steps": [{"id": "fly", "timeout": "1 h", "do": {PILOT: {"plan": dict(plan)}}}],
        "on_restart": "hold_and_ask",
    }


def plan_in(data: bytes) -> dict[str, Any]:
    """Decode a .plan or an ``aerial.mission.v1``; raises WireError."""
    try:
        document = decode_json(data, dict[str, Any])
    except (msgspec.DecodeError, RecursionError) as error:
        raise WireError(f"is no JSON: {error}") from None
    kinds: list[str] = []
    if document.get("fileType") == "Plan":
        try:
            kinds = _checked_made_for(document)
            document = _converted(document)
        except (AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
            raise WireError(f"is no plan of QGroundControl: {type(error).__name__}: {error}") from None
    plan_of(document, "")
    return document | ({MADE_FOR: kinds} if kinds else {})


def items_of(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return a plan in the form that robots accept, without ``made_for``."""
    return {key: value for key, value in plan.items() if key != MADE_FOR}


def made_for(plan: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the ``made_for`` of a plan; raises WireError if it is malformed."""
    found = plan.get(MADE_FOR, [])
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise WireError("is a list of words", where=MADE_FOR)
    return tuple(found)


def plan_needs(plan: Mapping[str, Any]) -> set[str]:
    """Return the capabilities that a robot needs to fly a plan."""
    return {PLAN, *(_FOR + each for each in made_for(plan))}


def plans_taken(kinds: Iterable[str]) -> set[str]:
    """Return the capabilities of a robot for plans of these autopilots and vehicles; none given: any."""
    return {PLAN, *(_FOR + each for each in set(kinds) or frozenset().union(*_KINDS))}


def plans_of(kinds: frozenset[str], autopilot: str, vehicle: str) -> frozenset[str]:
    """Narrow the kinds of plans that a robot may fly to the autopilot and vehicle that it has reported."""
    word = "multirotor" if vehicle.endswith("rotor") and not vehicle.startswith("vtol") else vehicle
    for every, said in zip(_KINDS, (autopilot, _CLASSES.get(word, word)), strict=True):
        if said in kinds:
            kinds -= every - {said}
    return kinds


def missing_text(missing: Collection[str]) -> str:
    """Describe the missing capabilities of a robot."""
    kinds = sorted(each.removeprefix(_FOR) for each in missing if each.startswith(_FOR))
    others = sorted(each for each in missing if not each.startswith(_FOR))
    words = [f"has no {', '.join(others)}"] if others else []
    words += [f"flies no plan made for {', '.join(kinds)}"] if kinds else []
    return " and ".join(words)


def _converted(document: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a .plan to an ``aerial.mission.v1``."""
    mission = document["mission"]
    for name, what in (("geoFence", "polygons"), ("geoFence", "circles"), ("rallyPoints", "points")):
        if document.get(name, {}).get(what):
            raise WireError(f"its {name} is not flown here", where=name)
    items: list[dict[str, Any]] = []
    above_sea: set[bool] = set()
    speed = None
    for at, item in enumerate(_simple(mission["items"])):
        where = f"mission.items.{at}"
        command, params = item["command"], item["params"]
        if command == _SPEED:
            speed = params[1]
            continue
        if command not in _ITEMS and command not in _TAKEOFFS:
            raise WireError(f"MAV_CMD {command} is not flown here", where=where)
        placed = not _is_nothing(params[4]) and not _is_nothing(params[5])
        if command in _TAKEOFFS and not placed:
            continue  # the robot takes off by itself
        kind, more = _ITEMS.get(command, _ITEMS[16])
        made: dict[str, Any] = {"type": kind, **more(params)}
        if placed:
            above_sea.add(_is_above_sea(item, where))
            made |= {"latitude": params[4], "longitude": params[5], "altitude_m": params[6]}
        if speed is not None:
            made["speed_ms"], speed = speed, None
        items.append(made)
    if len(above_sea) > 1:
        raise WireError("altitudes above home and above the sea are mixed", where="mission.items")
    home = mission.get("plannedHomePosition")
    return {
        "contract": CONTRACT,
        "name": "plan",
        "items": items,
        "altitude_reference": "amsl" if True in above_sea else "home",
    } | ({"home": {"latitude": home[0], "longitude": home[1], "altitude_amsl_m": home[2]}} if home else {})


def _checked_made_for(document: Mapping[str, Any]) -> list[str]:
    """Return the autopilot and the kind of vehicle named in a .plan."""
    found = []
    for key, words, other in (
        ("firmwareType", _AUTOPILOTS, "autopilot"),
        ("vehicleType", _VEHICLES, "vehicle of type"),
    ):
        number = document["mission"].get(key, _ANY)
        if not isinstance(number, int):
            raise WireError("must be a whole number", where=f"mission.{key}")
        if number != _ANY:
            found.append(words.get(number, f"{other} {number}"))
    return found


def _simple(items: list[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield simple items, including those inside complex items."""
    for item in items:
        if item["type"] == "SimpleItem":
            yield item
        elif item.get("complexItemType") in _LANDING_PATTERNS:
            yield from _landing_pattern(item)
        else:
            transect = item.get("TransectStyleComplexItem", item)
            yield from _simple(transect["Items"])


def _landing_pattern(item: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the items of a landing: its start, the approach at its height, and the touch-down.

    A VTOL lands like any other vehicle here: the robot itself chooses to land on its rotors.
    """
    frame = _ABOVE_HOME if item["altitudesAreRelative"] else _GLOBAL
    radius = abs(item["loiterRadius"]) * (1 if item["loiterClockwise"] else -1)
    circles = bool(item.get("useLoiterToAlt", True))
    approach = item["landingApproachCoordinate"]
    yield {"command": 189, "frame": _MISSION_FRAME, "params": [0, 0, 0, 0, 0, 0, 0]}
    first = [1, radius, 0, 1] if circles else [0, 0, 0, None]
    yield {"command": 31 if circles else 16, "frame": frame, "params": [*first, *approach]}
    yield {"command": LAND, "frame": frame, "params": [0, 0, 0, None, *item["landCoordinate"]]}


def _is_nothing(value: Any) -> bool:
    """Return True for a coordinate that is not given."""
    return value is None or value == 0 or (isinstance(value, float) and math.isnan(value))


def _is_above_sea(item: Mapping[str, Any], where: str) -> bool:
    """Return True for an altitude above sea level, False above home; raises WireError for terrain."""
    frame = item.get("frame", _ABOVE_HOME)
    if frame not in (_GLOBAL, _ABOVE_HOME, _MISSION_FRAME):
        raise WireError(f"MAV_FRAME {frame} is not flown here: above home or above the sea", where=where)
    return bool(frame == _GLOBAL)
