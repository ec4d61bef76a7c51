"""Description of a robot's commands, from its adapter's declarations and present admission. Pure."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping

import msgspec

from fleet.commands import CommandSpec
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.safety.fence import Fence
from fleet.model.description import (
    CommandDescription,
    FenceDescription,
    ParameterDescription,
    RobotDescription,
)
from fleet.robot_config import Limits
from fleet.wire.stops import STOP_WORDS

FindRefusal = Callable[[str, CommandSpec | None], str]
"""Returns why a command would be refused now; the spec is None for a command of the host itself."""
_WORDS: Mapping[object, str] = {float: "number", int: "whole number", str: "text", bool: "true or false"}
_HOST = {
    "release_emergency_stop": "Let the robot move again after an emergency stop.",
    "restart_adapter": "Start its adapter anew, also after a quarantine; a changed file is not loaded.",
    "follow_leader": "Lead its joints where its leader's are, until any stop.",
    "set_linear_velocity": "Store the speed of later verbs: linear=..., m/s.",
    "set_angular_velocity": "Store the turning speed of later verbs: angular=..., rad/s.",
    "stop": "Bring the robot to a standstill and hold it.",
    "emergency_stop": "Stop at once, and take no motion until released.",
    "hover": "As stop.",
    "brake": "As stop.",
    "take": "Take the robot out of the run of a mission; it holds.",
    "join_run": "A run of a mission takes the robot.",
    "leave_run": "A run of a mission gives the robot back.",
}
"""Commands that the host itself executes for every robot."""


def description(
    robot: str,
    adapter: str,
    can: Capabilities,
    *,
    own: Iterable[str],
    limits: Limits,
    refusal: FindRefusal,
    fence: Fence | None = None,
    posed: bool = True,
) -> RobotDescription:
    """Return the description of a robot. ``own``: commands of the host itself; stops are listed first.

    ``posed``: the robot has reported its pose, without which the host cannot lead it to goals.
    """
    names = [*sorted(STOP_WORDS), *sorted(own)]
    hosts = [CommandDescription(name, _HOST.get(name, ""), refusal=refusal(name, None)) for name in names]
    had = {name: spec for name, spec in sorted(can.commands.items()) if name not in can.lacking}
    declared = [command_of(spec, refusal(name, spec)) for name, spec in had.items()]
    verbs, goals = can.verbs, (can.drives or can.navigates) and "goto" not in can.lacking
    return RobotDescription(
        robot,
        adapter,
        (*declared, *(one for one in hosts if one.name not in can.commands)),
        drives=bool(verbs),
        verbs=verbs,
        goals=goals,
        goals_refusal="it has reported no pose" if goals and not (posed or can.navigates) else "",
        missions=can.navigates and "plan" not in can.lacking,
        plans=tuple(sorted(can.plans)),
        limits={name: value for name, value in limits if value is not None},
        fence=_fence(fence),
        body=can.body,
    )


def _fence(fence: Fence | None) -> FenceDescription | None:
    """Return the polygons of a fence; None without any."""
    if fence is None or not (fence.inclusion or fence.exclusion):
        return None
    return FenceDescription(fence.inclusion, fence.exclusion)


def command_of(spec: CommandSpec, refusal: str = "") -> CommandDescription:
    """Return the description of one declared command; ``refusal``: why it would be refused now."""
    parameters = tuple(_parameter(spec, field) for field in msgspec.structs.fields(spec.parameters))
    return CommandDescription(
        spec.name, spec.summary, parameters, spec.moves, spec.safe, spec.timeout, refusal
    )


def _parameter(spec: CommandSpec, field: msgspec.structs.FieldInfo) -> ParameterDescription:
    """Return the description of one parameter."""
    bounds = spec.ranges.get(field.name)
    default = "" if field.required or field.default in (None, msgspec.NODEFAULT) else str(field.default)
    return ParameterDescription(
        field.name,
        words(field.type),
        required=field.required,
        default=default,
        least=bounds.least if bounds and math.isfinite(bounds.least) else None,
        most=bounds.most if bounds and math.isfinite(bounds.most) else None,
        unit=bounds.unit if bounds else "",
    )


def words(kind: object) -> str:
    """Return the name of a type for people."""
    while typing.get_origin(kind) is typing.Annotated:
        kind = typing.get_args(kind)[0]
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(words(part) for part in parts if part is not type(None))
    if origin is typing.Literal:
        return " | ".join(map(str, parts))
    if origin in (list, tuple, set, frozenset) and parts:
        return f"list of {words(parts[0])}"
    if origin is dict or kind is dict:
        return "object"
    return _WORDS.get(kind, str(getattr(kind, "__name__", kind)))
