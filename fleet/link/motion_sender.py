"""Motion of one robot on one open link: repeats the newest velocity, and lets a stop overtake it.

``drive`` and ``look`` are called on one thread, ``halt`` on any, even while the first two are inside
``encode``. So each decision carries the turn in which it was made, and is not written after a later halt.
"""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.errors import LinkLost, NotReady
from fleet.link.latest_motion import LatestMotion, MotionFrames
from fleet.model.geometry import Velocity

POLL_INTERVAL = 0.02  # s between two calls of ``look``
STOP_REPEATS = 5  # repeats of a stop or of a zero velocity, in case the line lost it


class MotionSender:
    """Sends the motion of one robot. ``encode`` returns the frames for a velocity, ``stop`` those of a stop.

    ``every``: s between two repeats of a velocity; ``idle``: also send the stop while the robot is at rest.
    """

    def __init__(
        self,
        slot: LatestMotion,
        clock: Clock,
        *,
        encode: Callable[[Velocity], MotionFrames],
        stop: Callable[[], MotionFrames],
        every: float,
        idle: bool = False,
    ) -> None:
        self._slot = slot
        self._clock = clock
        self._encode = encode
        self._stop = stop
        self._every = every - POLL_INTERVAL / 2  # the nearest call of ``look`` repeats
        self._idle = idle
        self._held: tuple[int, Velocity | None] | None = None  # turn and velocity; no velocity: no repeats
        self._repeats = 0  # repeats left of a stop or a zero velocity
        self._written = 0.0

    @property
    def turn(self) -> int:
        """The current turn; pass it to ``carry_out`` with frames decided now."""
        return self._slot.turn

    def drive(self, velocity: Velocity) -> None:
        """Write this velocity and repeat it; raises NotReady, and whatever ``encode`` raises."""
        turn = self.turn
        self._put(self._encode(velocity), turn, velocity)

    def carry_out(self, frames: MotionFrames, turn: int) -> None:
        """Write a command that moves the robot and replaces the velocity; raises NotReady."""
        self._put(frames, turn, None)

    def _put(self, frames: MotionFrames, turn: int, velocity: Velocity | None) -> None:
        """Write frames decided in ``turn``, unless a halt came in between."""
        try:
            written = self._slot.put(frames, turn, at_once=velocity is None)
        except LinkLost as error:
            raise NotReady(str(error), hint="the link is being opened again") from error
        if not written:
            raise NotReady("the robot was stopped meanwhile")
        self._held = (turn, velocity)
        self._repeats = STOP_REPEATS
        self._written = self._clock.monotonic()

    def halt(self) -> bool:
        """Write the stop at once and schedule its repeats; from any thread. False: it was not written."""
        self._repeats = STOP_REPEATS
        return self._slot.halt(self._stop())

    def poll(self) -> None:
        """Write waiting motion and due repeats; call it every ``POLL_INTERVAL`` s. Raises LinkLost."""
        self._slot.flush()
        now = self._clock.monotonic()
        if now - self._written < self._every:
            return
        turn = self._slot.turn
        frames = self._again(turn)
        if frames:
            self._written = now
            self._slot.put(frames, turn)

    def _again(self, turn: int) -> MotionFrames:
        """Return the frames to repeat: a velocity while it is held; a stop or a zero a few times."""
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
