"""Navigation: goals, tasks, and the state machine of an action.

The six states, and the rule that an action has exactly one terminal status, are those of Cyberwave's
``navigate/status``.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping

import msgspec

from fleet.model.command import Origin, Transport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3


class Goal(msgspec.Struct, frozen=True):
    """One target position: exactly one of ``position`` (world, m) and ``geo`` is given.

    ``yaw`` is radians counter-clockwise from world +x, None to leave the heading to the robot.
    ``wait`` is the time to stay at the goal, seconds.
    """

    position: Vector3 | None = None
    geo: GeoPoint | None = None
    yaw: float | None = None
    wait: float = 0.0


class Constraints(msgspec.Struct, frozen=True):
    """Limits that the sender sets for one task; None: the robot's own limits apply."""

    max_speed: float | None = None  # m/s
    tolerance: float | None = None  # m


class GoTo(msgspec.Struct, frozen=True, tag="goto"):
    """Go to one goal."""

    goal: Goal
    constraints: Constraints = Constraints()


class FollowPath(msgspec.Struct, frozen=True, tag="path"):
    """Visit the goals in order, ``loops`` times."""

    goals: tuple[Goal, ...]
    loops: int = 1
    constraints: Constraints = Constraints()


class RelativeMove(msgspec.Struct, frozen=True, tag="relative_move"):
    """Move by ``translation`` metres from the current position; in the body frame, or the world's."""

    translation: Vector3
    body_frame: bool = True
    constraints: Constraints = Constraints()


class PlanItem(msgspec.Struct, frozen=True):
    """One item of a mission, with the names of ``aerial.mission.v1``.

    The altitude of ``point`` is relative to the datum of the mission. ``seconds`` or ``turns``: how long to
    loiter, at ``radius`` metres. ``tolerance``: metres within which a waypoint counts as reached. ``speed``
    (m/s) applies from the leg to this item onwards. None leaves the value to the robot.
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
    """Execute a mission from the robot's own memory, so that it needs no link meanwhile.

    Altitudes are metres above home, or above mean sea level when ``above_sea`` is set. ``home`` is the home
    position of the plan (m AMSL), None when the plan has none. ``resumed``: continue at the item where it was
    interrupted.
    """

    name: str
    items: tuple[PlanItem, ...]
    home: GeoPoint | None = None
    above_sea: bool = False
    constraints: Constraints = Constraints()
    resumed: bool = False


Task = GoTo | FollowPath | RelativeMove | FlyMission
"""Tasks of adapters."""


class FollowRobot(msgspec.Struct, frozen=True, tag="follow"):
    """Keep ``distance`` metres behind another robot of the edge; it only ends on request.

    The host moves the robot, with velocities and at its own height; no adapter gets this task.
    """

    robot: str
    distance: float
    constraints: Constraints = Constraints()


AnyTask = Task | FollowRobot
"""Tasks of robots; an adapter only gets a ``Task``."""


class Control(enum.StrEnum):
    """Controls of the running action."""

    STOP = "stop"  # end the action and hold position
    PAUSE = "pause"  # hold position; ``resume`` continues
    RESUME = "resume"


MISSION = "mission"


class Navigate(msgspec.Struct, frozen=True):
    """A navigation message: a new task, or a control of the running one; ``name`` is the command's name."""

    instruction: AnyTask | Control
    action_id: str = ""
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None
    name: str = "navigate"

    @property
    def of_mission(self) -> bool:
        """True for a mission, and for the control of a mission."""
        return self.name == MISSION

    @property
    def is_command(self) -> bool:
        """True for a task that was requested as a command: a verb with a distance."""
        return self.name not in ("navigate", MISSION)


class ActionState(enum.StrEnum):
    """State of an action."""

    QUEUED = "queued"  # accepted, not yet started
    RUNNING = "running"  # the robot is working on it
    BLOCKED = "blocked"  # the robot was commanded but makes no progress
    COMPLETED = "completed"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def terminal(self) -> bool:
        """True when no other state can follow."""
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
    """Progress of a command or action: percent 0 to 100, and a message of the robot; blocked when stuck.

    ``reached``: goals of the path already passed, counted over all loops. ``remaining``: metres left of the
    whole path, None while unknown.
    """

    percent: float
    message: str = ""
    blocked: bool = False
    reached: int = 0
    remaining: float | None = None
