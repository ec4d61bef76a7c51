"""Moving one joint a little, with a person beside the dog: ``fleet can jog``.

Only this joint's drive is configured and enabled, its torque is limited, and however the jog ends (a key, an
exception, the end) the joint is stopped by the drive's own means and the torque is taken off.
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
from fleet_quadruped.robot.description import DogDescription, Joint

log = logging.getLogger(__name__)

SPEED = 0.1  # rad/s
LEAST_DEGREES, MOST_DEGREES = 0.5, 10.0
MOST_SHARE = 0.3  # of the highest torque
_ENABLE, _STOP, _OFF = 1.0, 0.3, 1.0  # s: until enabled, of quick stop, until off
_HOLD = 0.5  # s at the end of the step
_WATCHED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


class Jog(NamedTuple):
    """What is to be done: radians from where the joint is, and N m at most."""

    joint: Joint
    step: float
    torque: float


class JogStopped(Exception):
    """A person has ended the jog."""


class Jogger:
    """One joint on the bench. ``interrupted`` is asked in every cycle whether somebody wants it to end."""

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
        """Look at the joint with its torque off; raises Refused when it must not be moved."""
        told = self._bench.settle()
        found = problems((self._jog.joint,), told)
        if found:
            raise Refused(found[0])
        joint, goal = self._jog.joint, told[0].angle + self._jog.step
        if not joint.low + self._margin <= goal <= joint.high - self._margin:
            raise Refused(
                f"{joint.name}: {goal:.3f} rad is outside {joint.low:g} to {joint.high:g}, "
                f"of which {self._margin:g} is kept"
            )

    def move(self) -> float:
        """Make the step; return how far the joint was seen to go. It is off afterwards, whatever happens.

        Raises Refused when it must not be moved, Stopped, Fault or LinkLost when it was not moved to its end.
        """
        drives = self._bench.drives
        try:
            drives.limit_torque(self._jog.torque)
            moved = self._stepped()
        except BaseException:
            self._brake()
            try:
                drives.limit_torque(None)
            except LinkError:  # why the jog ended matters more, and is raised
                name = self._jog.joint.name
                log.warning(
                    "%s: its torque is limited still; take its power off and on before it stands", name
                )
            raise
        self._brake()
        drives.limit_torque(None)
        return moved

    def _stepped(self) -> float:
        """Enable the drive and make the step; return how far the joint was seen to go."""
        self._check()
        start, drives = self._enabled(), self._bench.drives
        for target in ramp(start, self._jog.step, self._dt):
            told = self._cycle(partial(drives.write, Targets((target,), (0.0,), (0.0,))))
        return told.angle - start

    def _enabled(self) -> float:
        """Enable the drive; return where it is."""
        until = self._clock.monotonic() + _ENABLE
        while self._clock.monotonic() < until:
            told = self._cycle(self._bench.drives.enable)
            if told.power is Power.ENABLED:
                return told.angle
        raise Fault(f"{self._jog.joint.name}: wanted enabled, the drive is {told.power.value}")

    def _cycle(self, act: Callable[[], None]) -> JointFeedback:
        """Run a cycle; raises Stopped, Fault or LinkLost when the joint must not move on."""
        told = self._bench.cycle(act)[0]
        joint = self._jog.joint
        if self._interrupted():
            raise JogStopped
        if told.fault:
            raise Fault(f"{joint.name}: {told.fault}")
        if told.age > 5 * self._dt:
            raise LinkLost(f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent")
        return told

    def _brake(self) -> None:
        """Brake, then take the torque off."""
        drives = self._bench.drives
        for _ in range(math.ceil(_STOP / self._dt)):
            self._bench.cycle(drives.quick_stop)
        for _ in range(math.ceil(_OFF / self._dt)):
            if self._bench.look()[0].power in {Power.DISABLED, Power.FAULT}:
                return
        log.warning("%s: its drive was not seen to be off; take its power off", self._jog.joint.name)


def ramp(start: float, step: float, dt: float) -> Iterator[float]:
    """Yield the targets of a step, one a cycle: slowly there, then a while at its end."""
    count = max(1, math.ceil(abs(step) / (SPEED * dt)))
    yield from (start + step * number / count for number in range(1, count + 1))
    yield from [start + step] * math.ceil(_HOLD / dt)


def direction(joint: Joint, *, forwards: bool) -> str:
    """Return in words where the foot goes when the joint's angle grows (or shrinks) on a hanging leg."""
    grows, shrinks = (
        ("to its left", "to its right") if "abad" in joint.name else ("to the rear", "to the front")
    )
    return f"the foot {grows if forwards else shrinks}"


def verdict(joint: Joint, *, right: bool) -> str:
    """Return what is to be written into the description when a joint went the right way, or the other."""
    if right:
        return f"sign: {joint.sign}"
    return f"sign: {-joint.sign}; then calibrate again, the offset was measured with the other sign"


class Pressed:
    """Says whether a key was pressed, a signal came, or the input has ended, since ``watching`` began.

    A signal is only noted: an exception out of nowhere would cut short what brakes the joint.
    """

    def __init__(self) -> None:
        self._source: int | None = None
        self._signalled = False

    def __call__(self) -> bool:
        """Return True when the jog must end."""
        if self._signalled or self._source is None:
            return self._signalled
        return bool(select.select([self._source], [], [], 0.0)[0])

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Watch single keys and signals while the block runs."""
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
