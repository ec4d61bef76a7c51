"""Dry run of a request: the rules that it would meet now, without executing it."""

from __future__ import annotations

from fleet.commands import CommandSpec, arguments
from fleet.errors import Refused
from fleet.host.robot.controller import RobotController
from fleet.host.robot.host_commands import MOTION
from fleet.model.command import Command, Origin, Transport
from fleet.model.navigation import Control, Navigate


def would_refuse(controller: RobotController, name: str, spec: CommandSpec | None) -> str:
    """Return why a command from this computer would be refused now; empty when it would be accepted.

    ``spec`` is None for a command of the host itself.
    """
    request = Command(name, origin=Origin(Transport.BUS))
    moves, safe = (spec.moves, spec.safe) if spec else (name in MOTION, name not in MOTION)
    refusal = controller.would_refuse(request, moves=moves, safe=safe) or controller.guard.beginning(
        request, spec
    )
    if refusal or spec is None:
        return refusal or ""
    if controller.offline:
        return f"{controller.name} is offline: {controller.offline}"
    busy = controller.activity if spec.moves and not spec.interrupts else ""
    return f"busy with {busy}" if busy else ""


def against(controller: RobotController, request: Command | Navigate, spec: CommandSpec | None) -> str:
    """Return why a robot would not start a request from standstill now; empty when it would.

    ``spec`` is that of a command. Stricter than a request: a robot that is busy, even for the same sender, or
    whose emergency stop is set does not start together with others.
    """
    if controller.offline or controller.motion.activity:
        absent = f"{controller.name} is offline: {controller.offline}"
        return absent if controller.offline else f"busy with {controller.motion.activity}"
    if isinstance(request, Navigate):
        if isinstance(request.instruction, Control):
            return f"{request.name} is not started together"
        return (
            controller.would_refuse(request, moves=True, safe=False)
            or controller.task_refusal(request.instruction)
            or ""
        )
    if spec is None:
        return f"{controller.name} has no {request.name!r} that could be started together"
    try:
        arguments(spec, request.data)
    except Refused as error:
        return str(error)
    return (
        controller.would_refuse(request, moves=spec.moves, safe=spec.safe and not controller.latched)
        or controller.guard.beginning(request, spec)
        or ""
    )
