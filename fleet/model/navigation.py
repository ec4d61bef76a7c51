"""Going somewhere: goals, tasks, and the life of an action.

The six states and the rule of exactly one terminal status are Cyberwave's ``navigate/status``.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping

import msgspec

from fleet.model.command import Origin, Transport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3


class Goal(msgspec.Struct, frozen=True):
    """One place to be: exactly one of ``position`` (world, m) and ``geo`` is given.

    ``yaw`` is radians counter-clockwise from world +x, None to leave the heading to the robot.
    ``wait`` is seconds to stay there.
    """

    position: Vector3 | None = None
    geo: GeoPoint | None = None
    yaw: float | None = None
    wait: float = 0.0


class Constraints(msgspec.Struct, frozen=True):
    """What the asker limits on the way; None leaves it to the robot's own limits."""

    max_speed: float | None = None  # m/s
    tolerance: float | None = None  # m


class GoTo(msgspec.Struct, frozen=True, tag="goto"):
    """Be at one goal."""

    goal: Goal
    constraints: Constraints = Constraints()


class FollowPath(msgspec.Struct, frozen=True, tag="path"):
    """Be at each goal in turn, ``loops`` times."""

    goals: tuple[Goal, ...]
    loops: int = 1
    constraints: Constraints = Constraints()


class RelativeMove(msgspec.Struct, frozen=True, tag="relative_move"):
    """Be ``translation`` metres from here; in the body frame, or the world's."""

    translation: Vector3
    body_frame: bool = True
    constraints: Constraints = Constraints()


class PlanItem(msgspec.Struct, frozen=True):
    """One item of a mission, as ``aerial.mission.v1`` names them.

    ``point``'s altitude counts from what the mission says. ``seconds`` and ``turns`` to loiter, at ``radius``
    metres; ``tolerance`` metres at which a waypoint counts as reached; ``speed`` (m/s) from the way to this
    item on. None leaves it to the robot.
    """

    kind: str
    point: GeoPoint | None = None
    seconds: float = 0.0
    turns: int = 0
    radius: float | None = None
    clockwise: bool = True
    tolerance: float | None = None
    speed: float | None = None


class FlyMission(msgspec.Struct, frozen=True, tag="mission"):
    """Carry out a mission from the robot's own memory, so that it needs no link on the way.

    Altitudes are metres above home, or above the sea. ``home`` is where the plan begins (m AMSL), None when
    it does not say. ``resumed``: go on where it was left.
    """

    name: str
    items: tuple[PlanItem, ...]
    home: GeoPoint | None = None
    above_sea: bool = False
    constraints: Constraints = Constraints()
    resumed: bool = False


Task = GoTo | FollowPath | RelativeMove | FlyMission


class Control(enum.StrEnum):
    """What may be asked of the running action."""

    STOP = "stop"  # end it and hold
    PAUSE = "pause"  # hold; ``resume`` goes on
    RESUME = "resume"


MISSION = "mission"


class Navigate(msgspec.Struct, frozen=True):
    """A navigation message: a new task, or a control of the running one; ``name``: how it is called."""

    ask: Task | Control
    action_id: str = ""
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None
    name: str = "navigate"

    @property
    def of_mission(self) -> bool:
        """True for a mission, and for a control of one."""
        return self.name == MISSION


class ActionState(enum.StrEnum):
    """Where an action is in its life."""

    QUEUED = "queued"  # taken, not yet begun
    RUNNING = "running"  # the robot works on it
    BLOCKED = "blocked"  # the robot was commanded and does not get on
    COMPLETED = "completed"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def terminal(self) -> bool:
        """True when nothing can follow."""
        return not NEXT[self]


NEXT: Mapping[ActionState, frozenset[ActionState]] = {
    ActionState.QUEUED: frozenset(
        {ActionState.RUNNING, ActionState.COMPLETED, ActionState.FAILED, ActionState.CANCELLED}
    ),
    ActionState.RUNNING: frozenset(
        {
            ActionState.RUNNING,
            ActionState.BLOCKED,
            ActionState.COMPLETED,
            ActionState.FAILED,
            ActionState.CANCELLED,
        }
    ),
    ActionState.BLOCKED: frozenset({ActionState.RUNNING, ActionState.FAILED, ActionState.CANCELLED}),
    ActionState.COMPLETED: frozenset(),
    ActionState.FAILED: frozenset(),
    ActionState.CANCELLED: frozenset(),
}


class Progress(msgspec.Struct, frozen=True):
    """How far something is: percent 0 to 100, in the robot's own words; blocked when it is stuck.

    ``reached``: how many goals of the path (all loops counted) are behind. ``remaining``: metres that are
    left of all of it, None while they are unknown.
    """

    percent: float
    message: str = ""
    blocked: bool = False
    reached: int = 0
    remaining: float | None = None
