"""What one robot takes, and whether it would take it now: the answer to ``fleet describe``."""

from __future__ import annotations

import msgspec


class ParameterDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One parameter of a command: its type in words, whether it must be given, its default, its range."""

    name: str
    type: str
    required: bool = False
    default: str = ""
    least: float | None = None
    most: float | None = None
    unit: str = ""


class CommandDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One command. ``refusal``: why it would be refused if it were asked now; empty when it would be taken.

    ``moves``: the robot may move because of it; ``safe``: an emergency stop lets it through; ``timeout`` in
    seconds, 0 where the host answers itself.
    """

    name: str
    summary: str = ""
    parameters: tuple[ParameterDescription, ...] = ()
    moves: bool = False
    safe: bool = False
    timeout: float = 0.0
    refusal: str = ""


class RobotDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot: its commands by name, and which velocities, goals and missions it takes besides.

    ``verbs`` are motions with a speed or a distance (``move_forward``); ``limits`` are m/s, rad/s and m.
    """

    robot: str
    adapter: str
    commands: tuple[CommandDescription, ...]
    drives: bool = False
    verbs: tuple[str, ...] = ()
    goals: bool = False
    missions: bool = False
    limits: dict[str, float] = {}
