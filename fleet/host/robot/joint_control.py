"""Joint targets of one robot: within ranges and speeds, under a dead-man of their own.

Targets are a stream. Each is valid for its lease and no longer; then the joint holds its position. The first
starts at the measured position, and no joint moves faster than the robot declares, so a leader that is far
from its follower is approached and not jumped to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import CommandError, LinkError, Refused
from fleet.host.requests.event_reporter import robot_log
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.dedup_cache import DedupCache
from fleet.host.safety.joint_limits import approach, refusal
from fleet.model.command import Command, JointSetpoint, Origin, Reply, Transport
from fleet.model.joints import JointRange
from fleet.model.report import JointReport
from fleet.runtime.exception_barrier import call_guarded, failure_text
from fleet.wire.joints import LEADER

STEP = 0.04  # s between two steps of the joints
LONGEST_STEP = 0.1  # s that one step covers at most: after a blocked loop, joints do not jump to catch up
MEASURED = 1.0  # s after which a measured joint position is stale


class _DrivenJoint(msgspec.Struct):
    """One driven joint: last commanded position, target, and expiry (monotonic s)."""

    at: float
    target: float
    until: float


class _TargetRefused(Refused):
    """Refusal of a target without effect on the present targets."""


class JointControl:
    """Joint control of one robot. ``followers`` receive joint reports. ``lease``: lifetime of a target, s.

    ``barred`` returns why nothing may move the robot now, else None; ``halt`` writes its halt; ``crashed``
    receives an unexpected error of the adapter.
    """

    def __init__(
        self,
        clock: Clock,
        lease: float,
        *,
        barred: Callable[[], str | None],
        halt: Callable[[], None],
        crashed: Callable[[Exception], None],
    ) -> None:
        self.deadman = DeadMan()
        self.followers: list[Callable[[JointReport], object]] = []
        self._clock = clock
        self.lease = lease
        self._barred = barred
        self._halt = halt
        self._crashed = crashed
        self._adapter: Adapter[Any] | None = None
        self._led: dict[str, _DrivenJoint] = {}
        self._measured: dict[str, tuple[float, float]] = {}  # by joint: position, time (monotonic s)
        self._stepped = 0.0
        self._repeats: DedupCache[bool] = DedupCache()
        self._by: Origin | None = None  # sender of the request to follow the leader
        self._follow: Receipt | None = None  # of that request, until the first report of the leader

    def follow(self, request: Command, receipt: Receipt) -> None:
        """Start following the leader until any stop; done once one of its reports is followed."""
        self._end_follow("it was asked for again")
        self._led, self._by, self._follow = {}, request.origin, receipt
        self.deadman.feed(self._clock.monotonic(), self.lease)

    def followed(self, reply: Reply) -> None:
        """Process the answer to the leader's targets; the first one answers the request to follow."""
        receipt, self._follow = self._follow, None
        if receipt is None:
            return
        if reply.ok:
            receipt.done()
        else:
            self.release()
            receipt.reject(f"it does not follow its leader: {reply.reason}", hint=reply.hint)

    def _end_follow(self, why: str) -> None:
        """Refuse a request to follow for which no report of the leader was followed."""
        receipt, self._follow = self._follow, None
        if receipt is not None:
            receipt.reject(f"it follows no leader: {why}")

    def following(self, leader: JointReport) -> JointSetpoint | None:
        """Return the targets that a leader's report gives the joints of the same names; None if not followed.

        Their source type is ``edge_leader``, their session that of the sender of the request to follow. After
        a silent leader, following needs a new request.
        """
        by = self._by
        if by is None or not self.deadman.armed:
            self._by = None
            return None
        if _role(leader) == "follower":
            return None
        ranges = self._ranges()
        common = {joint: at for joint, at in leader.positions.items() if joint in ranges}
        origin = Origin(Transport.BUS, LEADER, by.session)
        return JointSetpoint(common or leader.positions, origin=origin, stamp=leader.stamp)

    def attach(self, adapter: Adapter[Any]) -> None:
        """Use the adapter of a new run."""
        self._adapter = adapter

    def observe(self, report: JointReport) -> None:
        """Record measured joint positions, and pass them to the followers."""
        now = self._clock.monotonic()
        if _role(report) != "leader":  # with two arms on one twin, only the follower's positions count
            self._measured.update({joint: (at, now) for joint, at in report.positions.items()})
        for tell in self.followers:
            tell(report)

    def forget(self) -> None:
        """Forget the adapter and the measured positions, at the end of its run."""
        self.release()
        self._adapter = None
        self._measured.clear()

    def apply(self, request: JointSetpoint, receipt: Receipt) -> bool:
        """Set joint targets and answer; return whether they were accepted."""
        now = self._clock.monotonic()
        if self._repeats.first(request.id, True, now):
            receipt.reject("it came before: it would move the joints once more")
            return False
        try:
            self._lead(request, now)
            self._step(now)
        except _TargetRefused as error:  # earlier targets stay valid for their lease
            receipt.reject(error.reason, hint=error.hint)
        except (CommandError, LinkError) as error:
            self.release()
            self.hold()
            receipt.fail(error)
        except Exception as error:  # noqa: BLE001 - exception barrier: passed to the runner, which stops the robot
            self._failed(error)
            receipt.reject(f"the adapter failed: {failure_text(error)}")
        else:
            receipt.done()
            return True
        return False

    def _lead(self, request: JointSetpoint, now: float) -> None:
        """Set targets; raises _TargetRefused, with nothing changed, if one is refused."""
        ranges = self._ranges()
        known = [joint for joint in request.positions if joint in ranges]
        starts = {joint: self._where(joint, now) for joint in known}
        wanted = {
            joint: starts.get(joint, 0.0) + target if request.relative else target
            for joint, target in request.positions.items()
        }
        why = refusal(wanted, ranges)
        if why is not None:
            raise _TargetRefused(why)
        if not self.deadman.armed:
            self._led, self._by, self._stepped = {}, None, now - STEP
        for joint, target in wanted.items():
            self._led[joint] = _DrivenJoint(starts[joint], target, now + self.lease)
        self.deadman.feed(now, self.lease)

    def _ranges(self) -> Mapping[str, JointRange]:
        """Return the joints that take targets now; none without an adapter."""
        return {} if self._adapter is None else call_guarded(self._adapter.joint_ranges)

    def _where(self, joint: str, now: float) -> float:
        """Return the position at which a joint continues; raises _TargetRefused if it is unknown."""
        if self.deadman.armed and joint in self._led:
            return self._led[joint].at
        at, seen = self._measured.get(joint, (0.0, float("-inf")))
        if now - seen > MEASURED:
            raise _TargetRefused(
                f"the position of joint {joint} is unknown", hint="it must be reported first"
            )
        return at

    def step(self) -> None:
        """Move the joints one step further; called on the event loop every ``STEP`` s."""
        if not self.deadman.armed:
            self._end_follow(f"no report of it within {self.lease:g} s, or something else came first")
            return
        try:
            self._step(self._clock.monotonic())
        except (CommandError, LinkError) as error:
            self.hold()
            if self._adapter is not None:
                robot_log(self._adapter.config.name).warning("joints are led no further: %s", error)
        except Exception as error:  # noqa: BLE001 - exception barrier: passed to the runner, which stops the robot
            self._failed(error)

    def _step(self, now: float) -> None:
        """Send each joint as far as its speed allows; raises the adapter's errors.

        A stop or the dead-man may intervene from another thread; the hold afterwards undoes a later write.
        """
        adapter, why = self._adapter, self._barred()
        if adapter is None or why:
            raise Refused(why or "it has no leader")
        seconds, self._stepped = min(now - self._stepped, LONGEST_STEP), now
        ranges = self._ranges()
        self._led = {joint: one for joint, one in self._led.items() if one.until > now and joint in ranges}
        for joint, one in self._led.items():
            one.at = approach(one.at, one.target, ranges[joint], seconds)
        if self._led:
            call_guarded(adapter.move_joints, {joint: one.at for joint, one in self._led.items()})
        if not self.deadman.armed or self._barred():
            self.hold()

    def release(self) -> None:
        """Drop all targets."""
        self.deadman.clear()
        self._led, self._by = {}, None

    def end(self) -> None:
        """End joint motion before the robot moves in another way."""
        if self.deadman.armed:
            self.hold()

    def hold(self) -> None:
        """Make the joints hold their positions at once; from any thread; never raises."""
        self.deadman.clear()
        adapter = self._adapter
        if adapter is None:
            return
        try:
            call_guarded(adapter.hold_joints)
        except Exception:  # noqa: BLE001 - logged
            robot_log(adapter.config.name).exception("its joints could not be held: it is halted")
            self._halt()

    def _failed(self, error: Exception) -> None:
        """Stop a robot whose adapter failed, and report the error."""
        self.release()
        self._halt()
        self._crashed(error)


def _role(report: JointReport) -> str | None:
    """Return which of two arms a report belongs to, if one twin has both."""
    return report.tags.role if report.tags is not None else None
