"""Small move of one joint with a person beside the robot: ``fleet can jog``.

Only this joint's drive is configured and enabled, and its torque is limited. However the jog ends (a key, an
exception, completion), the drive stops the joint by its own means and the torque is taken off.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import FrameType
from typing import NamedTuple

from fleet import CanBus, Clock, Fault, LinkError, LinkLost, Refused
from fleet_quadruped.bench_tools import BenchSession, problems
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.drives.base import JointFeedback, Power
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint

log = logging.getLogger(__name__)

SPEED = 0.1  # rad/s
LEAST_DEGREES, MOST_DEGREES = 0.5, 10.0
MOST_SHARE = 0.3  # of the joint's maximum torque
_ENABLE, _STOP, _OFF = 1.0, 0.3, 1.0  # s: limit for enabling, duration of the quick stop, limit for disabling
_HOLD = 0.5  # s at the end of the step
_WATCHED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


class Jog(NamedTuple):
    """Parameters of a jog: radians from the present angle, and the torque limit in N m."""

    joint: Joint
    step: float
    torque: float


class JogStopped(Exception):
    """The person at the bench has ended the jog."""


class Jogger:
    """One joint on the bench; ``interrupted`` is polled in every cycle, True ends the jog."""

    def __init__(
        self,
        dog: DogDescription,
        buses: Mapping[str, CanBus],
        clock: Clock,
        jog: Jog,
        interrupted: Callable[[], bool],
    ) -> None:
        self._jog = jog
        self._clock = clock
        self._interrupted = interrupted
        self._bench = BenchSession(dog, buses, clock, (jog.joint,))
        self._dt = dog.dt
        self._margin = dog.safety.margin

    def _check(self) -> None:
        """Inspect the joint with its torque off; raises Refused if it must not be moved."""
        reported = self._bench.settle()
        found = problems((self._jog.joint,), reported)
        if found:
            raise Refused(found[0])
        joint, goal = self._jog.joint, reported[0].angle + self._jog.step
        if not joint.low + self._margin <= goal <= joint.high - self._margin:
            raise Refused(
                f"{joint.name}: {goal:.3f} rad is outside {joint.low:g} to {joint.high:g}, "
                f"of which {self._margin:g} is kept"
            )

    def move(self) -> float:
        """Make the step; return how far the joint was seen to move, in rad. The drive is off afterwards.

        Raises Refused if the joint must not be moved; JogStopped, Fault or LinkLost if the move ended early.
        """
        drives = self._bench.drives
        try:
            drives.limit_torque(self._jog.torque)
            moved = self._stepped()
        except BaseException:
            self._brake()
            try:
                drives.limit_torque(None)
            except LinkError:  # the reason for the end matters more, and is raised
                name = self._jog.joint.name
                log.warning(
                    "%s: its torque is still limited; switch its power off and on before it stands", name
                )
            raise
        self._brake()
        drives.limit_torque(None)
        return moved

    def _stepped(self) -> float:
        """Enable the drive and make the step; return how far the joint was seen to move, in rad."""
        self._check()
        start, drives = self._enabled(), self._bench.drives
        for target in ramp(start, self._jog.step, self._dt):
            reported = self._cycle(partial(drives.write, Targets((target,), (0.0,), (0.0,))))
        return reported.angle - start

    def _enabled(self) -> float:
        """Enable the drive; return its angle in rad; raises Fault after a timeout."""
        until = self._clock.monotonic() + _ENABLE
        while self._clock.monotonic() < until:
            reported = self._cycle(self._bench.drives.enable)
            if reported.power is Power.ENABLED:
                return reported.angle
        raise Fault(f"{self._jog.joint.name}: wanted enabled, the drive is {reported.power.value}")

    def _cycle(self, act: Callable[[], None]) -> JointFeedback:
        """Run a cycle; raises JogStopped, Fault or LinkLost if the joint must not move on."""
        reported = self._bench.cycle(act)[0]
        joint = self._jog.joint
        if self._interrupted():
            raise JogStopped
        if reported.fault:
            raise Fault(f"{joint.name}: {reported.fault}")
        if reported.age > 5 * self._dt:
            raise LinkLost(f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent")
        return reported

    def _brake(self) -> None:
        """Stop the joint, then take the torque off."""
        drives = self._bench.drives
        for _ in range(math.ceil(_STOP / self._dt)):
            self._bench.cycle(drives.quick_stop)
        for _ in range(math.ceil(_OFF / self._dt)):
            if self._bench.read_feedback()[0].power in {Power.DISABLED, Power.FAULT}:
                return
        log.warning("%s: its drive did not report off; switch its power off", self._jog.joint.name)


def ramp(start: float, step: float, dt: float) -> Iterator[float]:
    """Yield the targets of a step, one per cycle: a ramp at SPEED, then a pause at its end."""
    count = max(1, math.ceil(abs(step) / (SPEED * dt)))
    yield from (start + step * number / count for number in range(1, count + 1))
    yield from [start + step] * math.ceil(_HOLD / dt)


def direction(joint: Joint, *, forwards: bool) -> str:
    """Describe where the foot of a hanging leg goes when the joint's angle grows (or shrinks)."""
    grows, shrinks = (
        ("to its left", "to its right") if "abad" in joint.name else ("to the rear", "to the front")
    )
    return f"the foot {grows if forwards else shrinks}"


def verdict(joint: Joint, *, right: bool) -> str:
    """Return the sign for the description, after a joint moved in the expected or the opposite direction."""
    if right:
        return f"sign: {joint.sign}"
    return f"sign: {-joint.sign}; then calibrate again, the offset was measured with the other sign"


class AbortInput:
    """Returns True after a key, a signal, or the end of the input since ``watching`` began.

    A signal only sets a flag: an exception at an arbitrary place could interrupt the braking of the joint.
    """

    def __init__(self) -> None:
        self._source: int | None = None
        self._signalled = False

    def __call__(self) -> bool:
        """Return True if the jog must end."""
        if self._signalled or self._source is None:
            return self._signalled
        return bool(select.select([self._source], [], [], 0.0)[0])

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Watch single keys and signals for the duration of the block."""
        source = self._source = sys.stdin.fileno()
        before = {number: signal.signal(number, self._note) for number in _WATCHED}
        modes = termios.tcgetattr(source) if os.isatty(source) else None
        if modes is not None:
            tty.setcbreak(source)
        try:
            yield
        finally:
            if modes is not None:
                termios.tcsetattr(source, termios.TCSAFLUSH, modes)
            for number, handler in before.items():
                signal.signal(number, handler)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self._signalled = True
