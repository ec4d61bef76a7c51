"""Motion guard: keeps one robot in its fence, within its battery and apart from others.

It judges goals before they start and motion while it happens, from the robot's reports of pose, home and
battery. The same rules hold for a person, the host's follower and the robot's own autopilot.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import Protocol

from fleet.clock import Clock
from fleet.commands import CommandSpec
from fleet.errors import Refused
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.battery_watch import BATTERY, BatteryWatch
from fleet.host.robot.fence_keeper import FenceKeeper
from fleet.host.robot.outside_fence import (
    ALLOWED_OUTSIDE,
    CLIMBS,
    LANDINGS,
    outside_trouble,
    stays_in_place,
    vertical_motion,
)
from fleet.host.robot.relative_positions import RelativePositions
from fleet.host.robot.robot_place import POSITION_UNKNOWN, RobotPlace
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.host.safety.circles import circling_radii
from fleet.model.command import Command, Reply
from fleet.model.event import EventKind
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity
from fleet.model.navigation import AnyTask, FlyMission, FollowRobot, RelativeMove
from fleet.model.report import BatteryReport, FlightControllerReport, PoseReport, Report
from fleet.robot_config import AdapterConfig, BatteryPolicy, Limits

BEGINNINGS = frozenset({"takeoff", "arm"})
"""Commands that start a flight: refused outside the fence and with too little battery."""


class GuardActions(Protocol):
    """Functions of the robot's controller that the guard uses."""

    can: Capabilities

    @property
    def free(self) -> bool:
        """True while no other party has it, and no stop or landing is in progress."""

    def end(self, why: str) -> None:
        """End motion that this edge commanded."""

    def receive(self, request: Command, receipt: Receipt) -> None:
        """Execute a command of the host."""


class MotionGuard:
    """Fence, battery watch and separation (``apart``) of one robot.

    ``robot`` is its controller. ``held`` is the body velocity that is being held; ``taken``: another party
    took the robot, and it has obeyed no request of ours since.
    """

    def __init__(
        self,
        config: AdapterConfig,
        limits: Limits,
        clock: Clock,
        *,
        robot: GuardActions,
        event_reporter: EventReporter,
    ) -> None:
        self._robot = robot
        self._event_reporter = event_reporter
        self.held = ZERO_VELOCITY
        self.taken = False
        self.apart: SeparationKeeper | None = None
        self.others = RelativePositions()
        self._battery: BatteryWatch | None = None
        self._policy: BatteryPolicy | None = None
        self._percent: float | None = None
        self._place = RobotPlace(config.origin, clock)
        self.fencing = FenceKeeper(self._place, config.fence, limits)
        self._armed = False
        self._circle = 0.0  # m; radius at the end of a task, for a robot that cannot hover
        self.configure(config, limits)

    def configure(self, config: AdapterConfig, limits: Limits) -> None:
        """Apply a changed fence, limits and battery policy, also to present motion."""
        self._takeoff_altitude = getattr(config, "takeoff_altitude", 0.0)
        self._limits = limits
        self.fencing.configure(config.fence, limits)
        before, self._policy = self._policy, config.battery_policy
        if self._policy is None:
            self._battery = None
        elif self._policy != before:
            self._battery = BatteryWatch(
                self._policy,
                event_reporter=self._event_reporter,
                request=self._robot.receive,
                free=lambda: not self.taken and self._robot.free,
            )
            self._battery.observe(self._percent)
        if self.apart is not None:
            self.apart.configure(config, limits)
        self._check_fence()

    # -- reports of the robot ------------------------------------------------------------------------

    def observe(self, report: Report) -> None:
        """Process a report; a pose out of bounds and a low battery have consequences."""
        match report:
            case PoseReport():
                pose = Pose(report.position, report.rotation)
                self._place.observe(pose)
                if self.apart is not None:
                    self.apart.observe(pose)
                self._check_fence()
            case BatteryReport():
                self._charged(report.percent)
            case FlightControllerReport():
                self._takes_off(armed=report.armed)
                if report.home != self._place.home:
                    self._place.home = report.home
                    self._moves_home()
            case _:
                pass

    def circles(self, radius: float) -> None:
        """Set the circling radius at the end of a task, m; 0: the robot stands."""
        self._circle = radius
        if self.apart is not None:
            self.apart.circle = radius

    def _moves_home(self) -> None:
        """Place the fence, and the robot among the others, relative to its new home."""
        self.fencing.draw()
        if self.apart is not None:
            self.apart.set_world_origin(self._place.world())

    def _takes_off(self, *, armed: bool) -> None:
        """Record whether the robot may be in the air."""
        self._armed = armed
        if self.apart is not None:
            self.apart.flies = armed

    def _charged(self, percent: float | None) -> None:
        """Record the battery level."""
        self._percent = percent
        if self._battery is not None:
            self._battery.observe(percent)
        if self.apart is not None:
            self.apart.battery = percent

    def share_space(self, apart: SeparationKeeper) -> None:
        """Enable separation from the other robots."""
        self.apart = self.others.among = apart
        apart.circle, apart.flies = self._circle, self._armed
        apart.set_world_origin(self._place.world())

    def obeyed(self, reply: Reply) -> None:
        """Process a reply to a moving request; a robot that has obeyed is under our control again."""
        self.taken = self.taken and not reply.done
        begins = reply.ok and reply.done is None
        if begins:
            self._report_landing(reply.command)
        if reply.command in LANDINGS and self.apart is not None:
            self.apart.reserve_landing(self._place.descent_points(reply.command) if begins else ())

    def _check_fence(self) -> None:
        """Report a fence breach once, and end motion that leads out of the fence."""
        if self.fencing.check():
            trouble = f"it is {self.fencing.trouble}"
            details = {"reason": self.fencing.trouble}
            self._event_reporter.event(EventKind.FENCE, trouble, telemetry="fence_breached", data=details)
            self._robot.end(f"fence: {trouble}")
        elif self.fencing.would_leave(self.held):
            self._robot.end("fence: the velocity leads out of it")

    @property
    def cause(self) -> str:
        """What the host did to the robot because of battery or separation; empty for nothing."""
        forced = self._battery.forced if self._battery is not None else ""
        return forced or (self.apart.cause if self.apart is not None else "")

    # -- checks of requests --------------------------------------------------------------------------

    def beginning(self, request: Command, spec: CommandSpec | None = None) -> str | None:
        """Return why a command may not start; else None.

        Judged are a start of a flight, a change of the height, and outside the fence all that may move the
        robot to another place, as ``spec`` declares it.
        """
        climbs = request.name in CLIMBS
        rise = vertical_motion(request, self._place, self._takeoff_altitude) if climbs else None
        if request.name in BEGINNINGS:
            begins = self._start_trouble()
        else:
            begins = (
                None if stays_in_place(request, spec) else outside_trouble(self.fencing, self._place, rise)
            )
        apart = self.apart if _drives_home(request, self._robot.can) else None
        met = (
            apart.trouble_on(self._place.descent_points(request.name))
            if apart is not None and apart.is_judged
            else ""
        )
        return (
            begins
            or (self._climb_trouble(rise) if climbs else None)
            or (f"its way home is not free: {met}" if met else None)
        )

    def _report_landing(self, name: str) -> None:
        """Report that a landing or return leads past another robot; it is not refused for that."""
        if name not in LANDINGS or self.apart is None:
            return
        trouble = self.apart.trouble_on(self._place.descent_points(name))
        if trouble:
            why = f"{name}: {trouble}; it is let through all the same"
            self._event_reporter.event(
                EventKind.SEPARATION, why, telemetry="separation", data={"reason": why}
            )

    def _climb_trouble(self, rise: Vector3 | None) -> str:
        """Return which robot is in the way straight up or down; empty for none."""
        if self.apart is None or not self.apart.is_judged:
            return ""
        pose = self._place.fresh()
        if pose is None:
            return POSITION_UNKNOWN
        if rise is None:
            return ""
        return self.apart.task_trouble(RelativeMove(rise, body_frame=False), (pose.position + rise,))

    def _start_trouble(self) -> str | None:
        """Return why a task whose path is unknown, such as a flight, may not start; None when it may."""
        if self.fencing.breached:
            return f"{self.fencing.breached}; {ALLOWED_OUTSIDE}"
        return (self._battery.start_trouble() or None) if self._battery else None

    def task(self, task: AnyTask | None) -> str | None:
        """Return why a task may not start or resume; None when it may, or without a task."""
        if isinstance(task, FollowRobot):
            return self.others.trouble(task.robot) or self._start_trouble()
        shares = self.apart is not None and self.apart.is_judged
        if task is None or (self._battery is None and self.fencing.is_open and not shares):
            return None
        try:
            start, points = self._route(task)
        except Refused as error:
            return str(error)
        home = self._place.home_point()
        around = circling_radii(task, self._circle)
        trouble = self.fencing.route_trouble(start, points, around)
        if trouble and self.fencing.trouble:
            trouble = f"{trouble}; {ALLOWED_OUTSIDE}"
        if not trouble and self._battery is not None and isinstance(task, FlyMission):
            trouble = self._battery.start_trouble()
        if not trouble and self._battery is not None:
            metres = _length((start, *points, home)) + math.tau * self._circle
            trouble = self._battery.trouble(metres, task.constraints.max_speed or self._limits.speed)
        if not trouble and self.apart is not None:
            trouble = self.apart.task_trouble(task, points)
        return trouble or None

    def _route(self, task: AnyTask) -> tuple[Vector3, tuple[Vector3, ...]]:
        """Return start and points of a task; raises Refused while they, or the fence, are unknown."""
        if self.fencing.fence is None:
            raise Refused("the fence cannot be placed until the robot reports its home")
        return self._place.route(task)

    def points(self, task: AnyTask) -> tuple[Vector3, ...]:
        """Return the points of a task in the robot's world; none while they are unknown."""
        try:
            return self._route(task)[1]
        except Refused:
            return ()

    def reserve_path(self, task: AnyTask | None) -> None:
        """Reserve the path of a task that the robot is prepared for; None releases it."""
        if self.apart is not None:
            self.apart.reserve_path(() if task is None else self.points(task))

    def limited_velocity(self, velocity: Velocity) -> Velocity:
        """Return the part of a body velocity that keeps the fence and the separation from others.

        Raises Refused while the fence is unknown.
        """
        velocity = self.fencing.inside(velocity)
        return velocity if self.apart is None or velocity.is_zero else self.apart.limited_velocity(velocity)


def _length(points: Iterable[Vector3]) -> float:
    """Return the length of a path, m."""
    points = tuple(points)
    return sum((later - sooner).norm() for sooner, later in itertools.pairwise(points))


def _drives_home(request: Command, can: Capabilities) -> bool:
    """Return whether a return home is judged like a goal; one by the battery policy is not.

    Flying robots are exempt: they first climb to a height that is set in the autopilot, and one that waits in
    the air for another lands later with less battery.
    """
    return request.name == "return_to_home" and can.command("land") is None and request.origin != BATTERY
