"""Admission of one robot's requests by source type, age, emergency stop, fault and control lease, in order.

Each rule is a module of this folder, which also words its refusal.
"""

from __future__ import annotations

from fleet.clock import Clock
from fleet.errors import Refused
from fleet.host.safety.control_lease import ControlLease
from fleet.host.safety.emergency_stop import RELEASE, EmergencyStopLatch
from fleet.host.safety.message_age import AgeCheck
from fleet.host.safety.motion_permit import MotionPermit
from fleet.host.safety.source_policy import SourcePolicy
from fleet.host.safety.stick_release import StickReleaseInterlock
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import RUN_SESSION, Command, JointSetpoint, Origin, Setpoint
from fleet.model.navigation import Control, Navigate
from fleet.robot_config import AdapterConfig, Limits
from fleet.wire.envelope import LONGEST_NAME
from fleet.wire.stops import STOP_WORDS

JOIN, LEAVE, TAKE = "join_run", "leave_run", "take"
"""Commands of the host: a mission run takes the robot or gives it back; a person takes it from the run."""


class Admission:
    """The safety rules of one robot. A judging method returns the refusal, or None to admit the request."""

    def __init__(
        self, config: AdapterConfig, clock: Clock, latch: EmergencyStopLatch, speeds: VerbSpeeds
    ) -> None:
        self._clock = clock
        self._ages = AgeCheck(config.clock_skew)
        self.offsets = self._ages.offsets  # senders' clock offsets, s
        self.latch = latch
        self.speeds = speeds
        self.fault = ""  # text of the fault that the robot itself latched; empty without one
        self.permit = MotionPermit()
        self.lease = ControlLease(config.control_lease)
        self._stick_release = StickReleaseInterlock(config.setpoint_lease)
        self.configure(config)

    def configure(self, config: AdapterConfig, limits: Limits | None = None) -> None:  # noqa: ARG002 - shared signature
        """Apply a changed configuration; recorded stops and sender clocks stay."""
        self._max_age, self._command_max_age = config.max_age, config.command_max_age
        self._policy = SourcePolicy(config.accepts, simulated=config.simulated)
        self.lease.seconds = config.control_lease
        self._stick_release.pause = config.setpoint_lease

    def stopped(self, request: Command) -> None:
        """Record a stop: it ends the sender's lease and makes earlier requests of the sender late.

        All other drivers have to release their sticks. Requests without a session may come from several
        senders, each with its own clock.
        """
        self.permit.stopped()
        self.speeds.forget()
        self.lease.release(request.origin.session)
        self.lease.others_moved(
            request.origin.session, f"stopped: {request.name} by {_named(request.origin)}"
        )
        self._stick_release.stopped(_sender_of(request.origin), self._clock.monotonic())
        wall, now = self._clock.time(), self._clock.monotonic()
        shared = not request.origin.session
        self._ages.stopped(_sender_of(request.origin), request.stamp, wall=wall, now=now, shared=shared)

    def taken_over(self, why: str) -> None:
        """Record a change of authority: another party controls the robot, or its adapter restarts."""
        self.speeds.forget()
        self.lease.free(why)

    def command(self, request: Command, *, moves: bool, safe: bool) -> str | None:
        """Judge a discrete command; stops are admitted from any sender at any age."""
        if request.name in STOP_WORDS:
            return None
        ends_a_stop = request.name == RELEASE or (moves and not safe)
        requested_for = request.name == JOIN and not request.origin.session.startswith(
            RUN_SESSION
        )  # by a person
        now, refusal = self._clock.monotonic(), self._policy.refusal(request.origin)
        if refusal is not None and request.name in (JOIN, LEAVE):
            # A run joins its robots in the name of the person who started it, whose rights may cover only
            # navigation. The run's steps are judged again one by one. The same rights are needed to leave.
            refusal = self._policy.refusal(request.origin, navigation=True)
        refusal = (
            refusal
            or self._age(request, now, self._command_max_age, moves=ends_a_stop or requested_for)
            or self._standing(request, now, moves=moves, safe=safe)
        )
        if refusal is None and ends_a_stop and request.name != RELEASE:
            self._acquire_lease(request.origin, now)
        if refusal is None and moves:  # a safe command does not take the robot out of its run
            self.lease.others_moved(
                request.origin.session, f"taken: {request.name} by {_named(request.origin)}"
            )
        return refusal

    def join(self, request: Command) -> None:
        """Give the robot to a mission run until it leaves; raises Refused."""
        refusal = self.motion() or self.lease.join(_run_in(request), self._clock.monotonic())
        if refusal is not None:
            raise Refused(refusal)

    def leave(self, request: Command) -> None:
        """Take the robot out of its run because the run ended or a person takes over."""
        if request.name == TAKE:
            self.lease.leave(f"taken: by {_named(request.origin)}")
        elif self.lease.run == _run_in(request):
            self.lease.leave("the run ended")

    def would_refuse(self, request: Command | Navigate, *, moves: bool, safe: bool) -> str | None:
        """Return why a command or goal would be refused now; dry run, the lease does not change."""
        if isinstance(request, Navigate):
            turn = self.lease.refusal(request.origin.session, self._clock.monotonic())
            return self._policy.refusal(request.origin, navigation=True) or self.motion() or turn
        if request.name in STOP_WORDS:
            return None
        now = self._clock.monotonic()
        return self._policy.refusal(request.origin) or self._standing(request, now, moves=moves, safe=safe)

    def _standing(self, request: Command, now: float, *, moves: bool, safe: bool) -> str | None:
        """Judge a command by the present state: a set stop, a fault, the control lease."""
        if request.name == RELEASE:
            return self.latch.held or None
        if request.origin.session.startswith(RUN_SESSION) and request.name not in (JOIN, LEAVE):
            refusal = self.lease.refusal(request.origin.session, now)
            if refusal is not None:  # a run may not touch a robot that left it, not even to land it
                return refusal
        if safe:
            return None
        if not moves:
            return self.latch.refusal()
        return self.motion() or self.lease.refusal(request.origin.session, now)

    def setpoint(self, request: Setpoint) -> str | None:
        """Judge a velocity. One that is refused for its age still counts as a held stick."""
        return self._stream(request, zero=request.velocity.is_zero)

    def joints(self, request: JointSetpoint) -> str | None:
        """Judge joint targets: a motion stream like velocities, but without a zero that ends it."""
        return self._stream(request, zero=False)

    def _stream(self, request: Setpoint | JointSetpoint, *, zero: bool) -> str | None:
        """Judge one message of a motion stream; ``zero``: it releases the stick."""
        sender, now = _sender_of(request.origin), self._clock.monotonic()
        refusal = self._policy.refusal(request.origin)
        if refusal is not None:
            return refusal
        late = self._age(request, now, self._max_age, ordered=True)
        if late is not None:
            self._stick_release.record_velocity(sender, now)
            return late
        # Before the latch: while the stop is set, a held stick would otherwise pass for a released one.
        holds = self._stick_release.refusal(sender, now, zero=zero)
        refusal = self.motion() or holds or self.lease.refusal(request.origin.session, now)
        if refusal is None:
            self._acquire_lease(request.origin, now)
            self._stick_release.record_velocity(sender, now)
        return refusal

    def is_untimely_zero(self, request: Setpoint) -> bool:
        """Return whether this is a zero where another velocity would be refused for its age or as motion."""
        if not request.velocity.is_zero:
            return False
        refusal = self.motion() or self._age(request, self._clock.monotonic(), self._max_age, ordered=True)
        return refusal is not None

    def untimely_zero(self, request: Setpoint) -> str | None:
        """Judge a zero velocity that is late, has a wrong stamp, or arrives while nothing may move.

        It may end motion and gives up the sender's lease, but never takes control. A late one proves nothing
        about the stick: it may be from before the stop after which the driver has to release it.
        """
        session, now = request.origin.session, self._clock.monotonic()
        refusal = self._policy.refusal(request.origin) or self.lease.refusal(session, now)
        if refusal is None:
            self.lease.release(session)
            if self._age(request, now, self._max_age, ordered=True) is None:
                self._stick_release.refusal(_sender_of(request.origin), now, zero=True)
        return refusal

    def navigate(self, request: Navigate) -> str | None:
        """Judge a navigation message; stop and pause are always admitted, resume counts as motion."""
        if request.instruction in (Control.STOP, Control.PAUSE):
            return None
        now = self._clock.monotonic()
        refusal = (
            self._policy.refusal(request.origin, navigation=True)
            or self._age(request, now, self._command_max_age)
            or self.motion()
            or self.lease.refusal(request.origin.session, now)
        )
        if refusal is None:
            self.speeds.driven_by(request.origin.session)
        return refusal

    def motion(self) -> str | None:
        """Return why nothing may move the robot, independent of the sender; None when motion is possible."""
        fault = f"it has a fault: {self.fault}" if self.fault else None
        return self.latch.refusal() or self.permit.refusal() or fault

    def _age(
        self,
        request: Command | Setpoint | JointSetpoint | Navigate,
        now: float,
        max_age: float,
        *,
        ordered: bool = False,
        moves: bool = True,
    ) -> str | None:
        """Judge the age of a message; a second call with the same message gives the same answer."""
        return self._ages.refusal(
            _sender_of(request.origin),
            request.stamp,
            wall=self._clock.time(),
            now=now,
            max_age=max_age,
            ordered=ordered,
            moves=moves,
        )

    def _acquire_lease(self, origin: Origin, now: float) -> None:
        """Give the control lease to the sender."""
        self.lease.acquire(origin.session, now)
        self.speeds.driven_by(origin.session)


def _run_in(request: Command) -> str:
    """Return the run id in a command; raises Refused."""
    run = request.data.get("run")
    if not isinstance(run, str) or not 0 < len(run) <= LONGEST_NAME:
        raise Refused(f"{request.name} needs run, the id of a run")
    return run


def _named(origin: Origin) -> str:
    """Return the sender's name for people."""
    return origin.session or origin.transport


def _sender_of(origin: Origin) -> str:
    """Return the key of a sender's clock."""
    return origin.transport + "/" + origin.session
