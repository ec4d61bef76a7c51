"""A base on an open line: received events, periodic work, and motion.

The receive callback only decodes bytes; everything else is done in ``turn``, which the host's tick scheduler
calls many times a second. ``halt`` may be called from any thread.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable

from fleet import (
    POLL_INTERVAL,
    Address,
    Clock,
    LatestMotion,
    Link,
    LinkLost,
    MotionFrames,
    MotionSender,
    NotReady,
    Robot,
    Vector3,
    Velocity,
)
from fleet_ugv.config import UgvConfig
from fleet_ugv.feedback_reporter import FeedbackReporter
from fleet_ugv.model import BaseFault, Confirmed, Feedback, UgvEvent
from fleet_ugv.readiness import Readiness

GREETING = 0.5  # s between two greetings of a silent base
TROUBLE_SHOWN = 30.0  # s for which a fault reported by the base is shown
INBOX = 1000  # events that may wait for ``turn``; more mean that the base floods the line
STANDS = 0.02  # m/s below which the base counts as standing
STANDS_TURNING = 0.1  # rad/s


class Inbox:
    """Events that were decoded from the line, with the times (monotonic, Unix s) at which they came."""

    def __init__(self, config: UgvConfig, clock: Clock) -> None:
        self.codec = config.base.codec(config.setting)
        self.events: deque[tuple[float, float, UgvEvent]] = deque(maxlen=INBOX)
        self._clock = clock

    def arrived(self, data: bytes, _address: Address) -> None:
        """Decode received bytes and queue their events."""
        now, stamp = self._clock.monotonic(), self._clock.time()
        self.events.extend((now, stamp, event) for event in self.codec.feed(data))


class Board:
    """A base on an open line. ``observer`` knows its pose and battery; ``stands``: seen to stand.

    ``serves`` is False once its line has fallen or is being left.
    """

    def __init__(
        self, config: UgvConfig, robot: Robot, observer: FeedbackReporter, inbox: Inbox, slot: LatestMotion
    ) -> None:
        self.observer = observer
        self.stands = asyncio.Event()
        self.serves = True
        self.codec = inbox.codec
        self._inbox = inbox.events
        self._config = config
        self._profile = config.base
        self._kinematics = config.kinematics
        self._robot = robot
        self._slot = slot
        self._motion = MotionSender(
            slot,
            robot.clock,
            encode=self._encode,
            stop=lambda: (self.codec.stop,),
            every=self._profile.keep,
            idle=self._profile.idle,
        )
        self._garbage = 0
        self._troubles: dict[str, float] = {}
        self._requested = robot.clock.monotonic()
        self.readiness = Readiness(
            confirms=self._profile.settable, guarded=self._profile.timeout is not None, now=self._requested
        )

    def begin(self, link: Link) -> None:
        """Serve the base on its link."""
        self._robot.leave_halt(link, filter(None, (self.codec.stop, self.codec.gimbal_stop)))
        self._slot.send(self.codec.hello(), self.codec.stop)
        self._robot.health(self.readiness.health)
        self._robot.every(POLL_INTERVAL, self.poll)

    def end(self) -> None:
        """Leave the base standing; what is asked of it from now on is not waited for."""
        self.serves = False
        self.halt()

    def drive(self, velocity: Velocity) -> None:
        """Hold a body velocity; raises NotReady, or Refused for motion that the base cannot make."""
        self._require_ready()
        self._motion.drive(self._guarded(velocity))

    def _require_ready(self) -> None:
        """Raise NotReady for a base that is not set up yet."""
        if self.readiness.refusal:
            raise NotReady(self.readiness.refusal, hint="try again in a moment")

    def _encode(self, velocity: Velocity) -> MotionFrames:
        """Encode a body velocity; raises Refused."""
        return (self.codec.motion(self._kinematics.inverse(velocity)),)

    def halt(self) -> bool:
        """Write the stops of wheels and mount at once; from any thread. False: not written."""
        written = self._motion.halt()
        self.hold_gimbal()
        return written

    def hold_gimbal(self) -> None:
        """Write the stop of the mount at once; from any thread."""
        if self.codec.gimbal_stop:
            with contextlib.suppress(LinkLost):  # then the mount stops at its last target
                self._slot.send(self.codec.gimbal_stop)

    def write(self, data: bytes) -> None:
        """Write a frame that moves no wheel; raises NotReady."""
        self._require_ready()
        try:
            self._slot.send(data)
        except LinkLost as error:
            raise NotReady(str(error), hint="the line is being opened again") from error

    def metrics(self) -> None:
        """Report the metrics."""
        stamp = self._robot.clock.time()
        self._robot.report(self.observer.metrics(stamp, self._errors()))

    def poll(self) -> None:
        """Handle events and due work; raises LinkLost when the base has been silent for too long."""
        now = self._robot.clock.monotonic()
        while self._inbox:
            at, stamp, event = self._inbox.popleft()
            self._handle_event(event, at, stamp)
        self._check_link(now)
        self._keep(now)
        if self.observer.metrics_due(now):
            self.metrics()

    def _handle_event(self, event: UgvEvent, at: float, stamp: float) -> None:
        """Handle one event."""
        match event:
            case Feedback():
                self._feedback(event, at, stamp)
            case Confirmed():
                self.readiness.confirmed()
            case BaseFault():
                if event.text not in self._troubles:
                    self._robot.log.warning("%s", event.text)
                self._troubles[event.text] = at

    def _feedback(self, feedback: Feedback, at: float, stamp: float) -> None:
        """Handle a measurement: report it, and set up a board that is new or was restarted."""
        step = self.observer.update(feedback, at)
        restarted = step is not None and step.restarted
        if restarted:
            self._robot.log.warning("the board restarted")
        if self.readiness.record_feedback(at, restarted=restarted):
            self._set_up()
        if abs(self.observer.speed) < STANDS and abs(self.observer.yaw_rate) < STANDS_TURNING:
            self.stands.set()
        else:
            self.stands.clear()
        for report in self.observer.reports(feedback, at, stamp):
            self._robot.report(report)

    def _check_link(self, now: float) -> None:
        """Detect silence and an unconfirmed setup, and report the health of the link."""
        before = self.readiness.phase
        if self.readiness.lost(now):
            raise LinkLost(
                f"{self._config.link}: nothing received for {self.readiness.quiet_for(now):.1f} s; "
                "is it the right device and speed?"
            )
        if self.readiness.check(now):
            self._set_up()
        if self.readiness.refusal and self.readiness.phase is not before:
            self.halt()
        self._robot.health(self.readiness.health)

    def _set_up(self) -> None:
        """Write the settings to the board; any motion ends with it."""
        self.halt()
        self._slot.send(self.codec.setup())

    def _keep(self, now: float) -> None:
        """Write the poll and the motion that are due."""
        if self._profile.poll:
            self._request(now, self._profile.poll, self.codec.poll)
        elif self.readiness.is_silent:
            self._request(now, GREETING, self.codec.hello)
        self._motion.poll()

    def _request(self, now: float, every: float, question: Callable[[], bytes]) -> None:
        """Write a poll when it is due."""
        if now - self._requested >= every - POLL_INTERVAL / 2:
            self._requested = now
            self._slot.send(question())

    def _guarded(self, velocity: Velocity) -> Velocity:
        """Return the velocity, limited when the base's own dead-man is not confirmed."""
        allowed, fastest = self._config.unguarded_speed, self._kinematics.fastest_wheel(velocity)
        if self.readiness.health.cause == "" or fastest <= allowed:
            return velocity
        scale = allowed / fastest
        return Velocity(Vector3(velocity.linear.x * scale), velocity.yaw_rate * scale)

    def _errors(self) -> tuple[dict[str, object], ...]:
        """Return recent faults reported by the base, and corrupted input of the line."""
        now = self._robot.clock.monotonic()
        self._troubles = {text: at for text, at in self._troubles.items() if now - at < TROUBLE_SHOWN}
        errors: list[dict[str, object]] = [{"code": "base", "message": text} for text in self._troubles]
        spoiled, self._garbage = self.codec.garbage - self._garbage, self.codec.garbage
        if spoiled:
            errors.append({"code": "line", "message": f"{spoiled} pieces made no sense", "count": spoiled})
        if self._slot.superseded:
            count = self._slot.superseded
            errors.append({"code": "backlog", "message": f"{count} motions were replaced", "count": count})
        return tuple(errors)
