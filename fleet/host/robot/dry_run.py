"""Whether a command would be taken now: the rules that it would meet, asked without carrying it out."""

from __future__ import annotations

from fleet.commands import CommandSpec
from fleet.host.robot.controller import RobotController
from fleet.host.robot.own_commands import MOTION
from fleet.model.command import Command, Origin, Transport


def would_refuse(controller: RobotController, name: str, spec: CommandSpec | None) -> str:
    """Return why a command from this computer would be refused now; empty when it would be taken.

    ``spec`` is None for what the host answers itself.
    """
    ask = Command(name, origin=Origin(Transport.BUS))
    moves, safe = (spec.moves, spec.safe) if spec else (name in MOTION, name not in MOTION)
    refusal = controller.would_refuse(ask, moves=moves, safe=safe) or controller.guard.beginning(ask)
    if refusal or spec is None:
        return refusal or ""
    if controller.offline:
        return f"{controller.name} is offline: {controller.offline}"
    busy = controller.activity if spec.moves and not spec.interrupts else ""
    return f"busy with {busy}" if busy else ""
