"""The motion of one robot on one open link: the newest velocity kept up, and the stop that overtakes it.

``drive`` and ``look`` are called on one thread, ``halt`` on any, also while the former are inside a
translation. So what is decided carries the turn it was decided in, and is not written after a later halt.
"""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.errors import LinkLost, NotReady
from fleet.link.latest_motion import Frames, LatestMotion
from fleet.model.geometry import Velocity

LOOK = 0.02  # s between two looks
STOP_REPEATS = 5  # times that a stop or a zero is repeated, in case the line lost it


class MotionSender:
    """What moves one robot. ``encode`` gives the frames that hold a velocity, ``stop`` those that end it.

    ``every``: s between two frames that hold a velocity; ``idle``: a robot at rest is told so as well.
    """

    def __init__(
        self,
        slot: LatestMotion,
        clock: Clock,
        *,
        encode: Callable[[Velocity], Frames],
        stop: Callable[[], Frames],
        every: float,
        idle: bool = False,
    ) -> None:
        self._slot = slot
        self._clock = clock
        self._encode = encode
        self._stop = stop
        self._every = every - LOOK / 2  # the look that is nearest
        self._idle = idle
        self._held: tuple[int, Velocity | None] | None = None  # since which turn; None: nothing is kept up
        self._repeats = 0  # left of what is not motion
        self._written = 0.0

    @property
    def turn(self) -> int:
        """The turn of what is decided now, for ``carry_out``."""
        return self._slot.turn

    def drive(self, velocity: Velocity) -> None:
        """Write this velocity and keep it up; raises NotReady, and what the translation raises."""
        turn = self.turn
        self._put(self._encode(velocity), turn, velocity)

    def carry_out(self, frames: Frames, turn: int) -> None:
        """Write a command that moves the robot, in place of a velocity; raises NotReady."""
        self._put(frames, turn, None)

    def _put(self, frames: Frames, turn: int, velocity: Velocity | None) -> None:
        """Write what was decided in ``turn``, unless a halt came in between."""
        try:
            written = self._slot.put(frames, turn, at_once=velocity is None)
        except LinkLost as error:
            raise NotReady(str(error), hint="the link is being opened again") from error
        if not written:
            raise NotReady("the robot was stopped meanwhile")
        self._held = (turn, velocity)
        self._repeats = STOP_REPEATS
        self._written = self._clock.monotonic()

    def halt(self) -> None:
        """Write the stop at once, and a few times more; from any thread."""
        self._repeats = STOP_REPEATS
        self._slot.halt(self._stop())

    def look(self) -> None:
        """Write what waits, and what is due again; call it every ``LOOK`` s. Raises LinkLost."""
        self._slot.flush()
        now = self._clock.monotonic()
        if now - self._written < self._every:
            return
        turn = self._slot.turn
        frames = self._again(turn)
        if frames:
            self._written = now
            self._slot.put(frames, turn)

    def _again(self, turn: int) -> Frames:
        """Return what is due again: a velocity, for as long as it is held; a stop or a zero, a few times."""
        velocity = None
        if self._held is not None and self._held[0] == turn:
            velocity = self._held[1]
            if velocity is None:
                return ()
            if not velocity.is_zero:
                return self._encode(velocity)
        if self._repeats == 0 and not self._idle:
            return ()
        self._repeats = max(0, self._repeats - 1)
        return self._stop() if velocity is None else self._encode(velocity)
