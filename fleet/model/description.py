"""Commands that one robot accepts, and whether it would accept them now: the answer to ``fleet describe``."""

from __future__ import annotations

import msgspec

from fleet.model.body import BodyPart
from fleet.model.polygon import Polygon


class ParameterDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One parameter of a command: type in words, whether it is required, default, range and unit."""

    name: str
    type: str
    required: bool = False
    default: str = ""
    least: float | None = None
    most: float | None = None
    unit: str = ""


class CommandDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One command. ``refusal``: why it would be refused if it were sent now; empty when it would be accepted.

    ``moves``: it may move the robot; ``safe``: it is accepted during an emergency stop; ``timeout`` in
    seconds, 0 if the host answers without the robot.
    """

    name: str
    summary: str = ""
    parameters: tuple[ParameterDescription, ...] = ()
    moves: bool = False
    safe: bool = False
    timeout: float = 0.0
    refusal: str = ""


class FenceDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """The polygons of a robot's fence, corners in metres in its world.

    The robot must be in one of ``inclusion``, if there are any, and in none of ``exclusion``.
    """

    inclusion: tuple[Polygon, ...] = ()
    exclusion: tuple[Polygon, ...] = ()


class RobotDescription(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot: its commands, and whether it also accepts velocities, goals and missions.

    ``plans``: autopilots and kinds of vehicle whose mission files it can fly; none: any. ``verbs`` are
    motions with a speed or a distance (``move_forward``); ``goals_refusal``: why it would refuse any goal
    now; empty if it would not; ``limits`` are in m/s, rad/s and m. ``body``: for
    drawings of it.
    """

    robot: str
    adapter: str
    commands: tuple[CommandDescription, ...]
    drives: bool = False
    verbs: tuple[str, ...] = ()
    goals: bool = False
    goals_refusal: str = ""
    missions: bool = False
    plans: tuple[str, ...] = ()
    limits: dict[str, float] = {}
    fence: FenceDescription | None = None
    body: tuple[BodyPart, ...] = ()
