"""Decoder of ``T mission/command``: missions that a robot executes from its own memory, and controls.

A mission is given as ``mission``, an ``aerial.mission.v1``, or as ``steps``, each with its type and params,
which become the items of one. An incomplete mission (an item without a position, no item with one, items
after the end) is refused with the path of the fault, before the robot receives any of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fleet.errors import WireError
from fleet.model.command import Command, Transport
from fleet.model.geodesy import GeoPoint
from fleet.model.navigation import MISSION, Constraints, Control, FlyMission, Navigate, PlanItem
from fleet.wire.envelope import BadCommand, name_of, optional_word, origin_and_stamp, stop_requested, tolerant
from fleet.wire.measures import not_negative, positive, within
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.strict_json import child, kind, parse_object, path, read_loosely, text, whole
from fleet.wire.strict_json import without_nulls as given

CONTRACT = "aerial.mission.v1"
EXECUTION = "mission_execution_uuid"
MOST_ITEMS = 500
HIGHEST = 10_000.0  # m; an altitude beyond it is a mistake
LONGEST = 3600.0  # s to loiter

CONTROLS: Mapping[str, Control] = MappingProxyType(
    {"cancel": Control.STOP, "stop": Control.STOP, "pause": Control.PAUSE, "resume": Control.RESUME}
)
_PLACED = frozenset(
    {"waypoint", "loiter_time", "loiter_turns", "loiter_unlimited", "loiter_to_altitude", "land"}
)
_ENDS = frozenset({"return_to_launch", "loiter_unlimited", "land"})
_UNPLACED = frozenset({"return_to_launch", "land_start"})
_PLAN_FIELDS = frozenset(
    {
        "contract",
        "name",
        "home",
        "items",
        "altitude_reference",
        "default_altitude_m",
        "cruise_speed_ms",
        "night",
    }
)
_ITEM_FIELDS = frozenset(
    {
        "type",
        "latitude",
        "longitude",
        "altitude_m",
        "seconds",
        "turns",
        "radius_m",
        "direction",
        "acceptance_radius_m",
        "speed_ms",
    }
)


def decode_mission(payload: bytes, *, transport: Transport, twin: str = "") -> Navigate | Command:
    """Return the mission, the control or the stop in a message.

    Raises BadCommand with the name and the execution id, as far as they could be read.
    """
    name = execution = ""
    try:
        message = given(parse_object(payload))
        name = name_of(message)
        control = CONTROLS.get(name)
        stop = None if control else stop_requested(message, transport)
        if stop is not None:
            return stop
        stops = control is Control.STOP
        execution = tolerant(optional_word, message, EXECUTION, strict=not stops) or ""
        origin, stamp = origin_and_stamp(message, transport, strict=not stops, twin=twin)
        request = control or _started(name, message, execution)
    except WireError as error:
        execution = execution or read_loosely(payload, EXECUTION)
        raise BadCommand(error, command=name or "mission", action_id=execution) from None
    return Navigate(request, execution, origin, stamp, MISSION)


def document_in(payload: bytes) -> dict[str, object]:
    """Return the ``aerial.mission.v1`` of a ``start`` command, as a document; raises WireError."""
    return _document(given(parse_object(payload)))


def run_of(action_id: str) -> str:
    """Return the run of the part of a mission that an action carries out; empty for any other action.

    The identity of a part is run/step/robot/attempt.
    """
    run, *rest = action_id.split("/")
    return run if len(rest) == 3 else ""


def _started(name: str, message: Mapping[str, object], execution: str) -> FlyMission:
    """Read the mission of a ``start`` command."""
    if name != "start":
        raise WireError(f"start, pause, resume or cancel is needed, not {name!a}", where="command")
    if not execution:
        raise WireError("is missing", where=EXECUTION)
    return plan_of(_document(message), "mission" if "mission" in message else "")


def _document(message: Mapping[str, object]) -> dict[str, object]:
    """Return the mission of a message, or its steps as the items of one."""
    if "mission" in message:
        return given(child(message, "mission"))
    steps = _items(message, "steps", "")
    items = []
    for at, step in enumerate(steps):
        where = f"steps.{at}"
        members = _members(step, where)
        params = given(child(members, "params", where)) if "params" in members else {}
        items.append({**params, "type": text(members, "type", where)})
    return {"contract": CONTRACT, "name": message.get("name") or "steps", "items": items}


def plan_of(mission: Mapping[str, object], where: str) -> FlyMission:
    """Read an ``aerial.mission.v1``; raises WireError with the path of a missing or wrong field."""
    if mission.get("contract") != CONTRACT:
        raise WireError(f"must be {CONTRACT}", where=path(where, "contract"))
    refuse_misspelt(mission, _PLAN_FIELDS, where)
    reference = mission.get("altitude_reference", "home")
    if reference not in {"home", "amsl"}:
        raise WireError(
            f"altitudes above {str(reference)[:40]!a} are not flown here; home or amsl are",
            where=path(where, "altitude_reference"),
        )
    default = _altitude(mission, "default_altitude_m", where)
    items = tuple(
        _item(item, path(where, f"items.{at}"), default)
        for at, item in enumerate(_items(mission, "items", where))
    )
    _require_an_order(items, where)
    return FlyMission(
        name=text(mission, "name", where)[:200],
        items=items,
        home=_home(given(child(mission, "home", where)), path(where, "home")) if "home" in mission else None,
        above_sea=reference == "amsl",
        constraints=Constraints(positive(mission, "cruise_speed_ms", where)),
    )


def _require_an_order(items: tuple[PlanItem, ...], where: str) -> None:
    """Raise WireError for a mission without any position, or with items after its end."""
    if not any(item.point for item in items):
        raise WireError("at least one item must have a place", where=path(where, "items"))
    for at, item in enumerate(items[:-1]):
        if item.kind in _ENDS:
            raise WireError(f"nothing may follow {item.kind}", where=path(where, f"items.{at + 1}"))


def _item(value: object, where: str, default: float | None) -> PlanItem:
    """Read one item; ``default`` is the altitude of an item without one."""
    item = _members(value, where)
    refuse_misspelt(item, _ITEM_FIELDS, where)
    form = text(item, "type", where)
    if form not in _PLACED | _UNPLACED:
        known = ", ".join(sorted(_PLACED | _UNPLACED))
        raise WireError(f"{form[:40]!a} is no item ({known})", where=path(where, "type"))
    point = _place(item, where, default) if form in _PLACED or "latitude" in item else None
    direction = item.get("direction", "cw")
    if direction not in {"cw", "ccw"}:
        raise WireError("cw or ccw is needed", where=path(where, "direction"))
    return PlanItem(
        kind=form,
        point=point,
        seconds=_seconds(item, where) if form == "loiter_time" else 0.0,
        turns=_turns(item, where) if form == "loiter_turns" else 0,
        radius=not_negative(item, "radius_m", where),
        clockwise=direction == "cw",
        tolerance=not_negative(item, "acceptance_radius_m", where),
        speed=positive(item, "speed_ms", where),
    )


def _place(item: Mapping[str, object], where: str, default: float | None) -> GeoPoint:
    """Read the position of an item; its altitude is relative to the mission's reference."""
    latitude, longitude = within(item, "latitude", where, 89.9), within(item, "longitude", where, 180.0)
    altitude = _altitude(item, "altitude_m", where)
    if altitude is None:
        altitude = default
    if altitude is None:
        raise WireError(
            "is missing, and the mission has no default_altitude_m", where=path(where, "altitude_m")
        )
    return GeoPoint(latitude, longitude, altitude)


def _altitude(members: Mapping[str, object], name: str, where: str) -> float | None:
    """Read an optional altitude in m, None when it is missing."""
    return within(members, name, where, HIGHEST) if name in members else None


def _home(home: Mapping[str, object], where: str) -> GeoPoint:
    """Read the planned take-off position, m AMSL."""
    return GeoPoint(
        within(home, "latitude", where, 90.0),
        within(home, "longitude", where, 180.0),
        within(home, "altitude_amsl_m", where, HIGHEST),
    )


def _items(message: Mapping[str, object], name: str, where: str) -> list[object]:
    """Return an array of 1 to ``MOST_ITEMS`` items; raises WireError for anything else."""
    items = message.get(name)
    if not isinstance(items, list) or not 1 <= len(items) <= MOST_ITEMS:
        raise WireError(f"an array of 1 to {MOST_ITEMS} is needed", where=path(where, name))
    return items


def _members(value: object, where: str) -> dict[str, object]:
    """Return the members of an object, without nulls; raises WireError for anything else."""
    if not isinstance(value, dict):
        raise WireError(f"an object is needed, this is {kind(value)}", where=where)
    return given(value)


def _seconds(item: Mapping[str, object], where: str) -> float:
    """Return the time to loiter, seconds."""
    seconds = positive(item, "seconds", where)
    if seconds is None or seconds > LONGEST:
        raise WireError(f"0 to {LONGEST:g} seconds are needed", where=path(where, "seconds"))
    return seconds


def _turns(item: Mapping[str, object], where: str) -> int:
    """Return the number of turns to loiter: the autopilot stores it in one byte."""
    turns = whole(item, "turns", where)
    if not 1 <= turns <= 255:
        raise WireError(f"1 to 255 are possible, not {turns}", where=path(where, "turns"))
    return turns
