"""Odometry of a base, from its counters and its gyro; pure.

Distance comes from the counters (or the speeds, without counters), heading from the gyro, because one step
of a coarse counter on one side amounts to degrees of heading. The gyro's bias is learned at standstill.
"""

from __future__ import annotations

import math

import msgspec

from fleet import Pose, Vector3, quaternion_from_yaw, wrap_angle
from fleet_ugv.model import Feedback

POSE = "pose"  # the key of ``robot.state`` under which its last pose is kept
GAP = 1.0  # s without feedback after which the motion in between counts as unknown
SPARE = 0.05  # m by which a counter may exceed the wheels' top speed: its own step size
FRESH = 0.3  # m; counters that fall below this were reset
STANDS_AFTER = 0.5  # s without a step of a counter until the base counts as standing
TURNED_BY_HAND = 0.05  # rad/s above which the rotation of a standing base is no longer taken for gyro bias
LEARN = 0.02  # share of the bias that one measurement at standstill replaces
DRIFT = 0.003  # rad/s of heading that becomes uncertain with a gyro
SLIP = 0.03  # share of the distance that becomes uncertain
SLIP_TURN = 0.15  # share of a turn that becomes uncertain when only the wheels measure it


class Scale(msgspec.Struct, frozen=True):
    """Calibration: true metres per reported metre of each side, effective track (m), factor of the gyro.

    ``wrap``: metres at which the counters wrap around, None when they do not.
    """

    track: float
    left: float = 1.0
    right: float = 1.0
    gyro: float = 1.0
    wrap: float | None = None


class OdometryStep(msgspec.Struct, frozen=True):
    """Motion measured by one feedback: m/s, rad/s. ``restarted``: the counters, so the board, were reset."""

    speed: float
    yaw_rate: float
    restarted: bool = False


class WheelOdometry:
    """Pose estimate of one base; ``fastest``: top speed of a side, m/s.

    ``position_sigma`` (m) and ``heading_sigma`` (rad) grow with the distance.
    """

    def __init__(self, scale: Scale, fastest: float, start: Pose | None = None) -> None:
        start = start or Pose()
        self.x, self.y = start.position.x, start.position.y
        self.yaw = start.rotation.yaw
        self.bias = 0.0
        self.travelled = (0.0, 0.0)
        self._position_variance = 0.0
        self._heading_variance = 0.0
        self._scale = scale
        self._fastest = fastest
        self._last: Feedback | None = None
        self._last_at = 0.0
        self._stepped_at = 0.0
        self._lessons = 0

    @property
    def pose(self) -> Pose:
        """The pose in the world frame, level."""
        return Pose(Vector3(self.x, self.y), quaternion_from_yaw(self.yaw))

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position, m."""
        return math.sqrt(self._position_variance)

    @property
    def heading_sigma(self) -> float:
        """Standard deviation of the heading, rad."""
        return math.sqrt(self._heading_variance)

    def level(self, rate: float) -> float:
        """Return the yaw rate (rad/s) for a measured one, calibrated and without bias."""
        return rate * self._scale.gyro - self.bias

    def scaled(self, sides: tuple[float, float]) -> tuple[float, float]:
        """Return calibrated values of the two sides, m or m/s."""
        return sides[0] * self._scale.left, sides[1] * self._scale.right

    def update(self, feedback: Feedback, now: float) -> OdometryStep | None:
        """Take a feedback measured at ``now`` (monotonic s); None when it gives no motion.

        A jump that is too fast for the wheels is skipped: the line was corrupted, or the feedback was late.
        The next feedback is compared with the one before the jump, so that no distance is lost.
        """
        last, elapsed = self._last, now - self._last_at
        if last is None or elapsed > GAP:
            return self._begin(feedback, now, restarted=last is not None and _is_reset(last, feedback))
        sides = self._sides(last, feedback, elapsed) if elapsed > 0.0 else None
        if sides is None:
            return self._begin(feedback, now, restarted=True) if _is_reset(last, feedback) else None
        self._last, self._last_at = feedback, now
        if sides != (0.0, 0.0):
            self._stepped_at = now
        self.travelled = (self.travelled[0] + sides[0], self.travelled[1] + sides[1])
        turned = self._turned(sides, last, feedback, now, elapsed)
        self._move((sides[0] + sides[1]) / 2, turned, elapsed, by_gyro=_gyro(feedback) is not None)
        return self._step(sides, turned, elapsed, feedback)

    def _begin(self, feedback: Feedback, now: float, *, restarted: bool) -> OdometryStep:
        """Count from here on."""
        self._last, self._last_at, self._stepped_at = feedback, now, now
        return OdometryStep(0.0, 0.0, restarted)

    def _step(
        self, sides: tuple[float, float], turned: float, elapsed: float, feedback: Feedback
    ) -> OdometryStep:
        """Return the speeds; reported ones, if any, because they are finer than the counters' steps."""
        if feedback.speeds is None:
            return OdometryStep((sides[0] + sides[1]) / 2 / elapsed, turned / elapsed)
        return OdometryStep(sum(self.scaled(feedback.speeds)) / 2, turned / elapsed)

    def _sides(self, last: Feedback, now: Feedback, elapsed: float) -> tuple[float, float] | None:
        """Return the distance of each side, m; None for a jump that is too fast for the wheels."""
        scale = self._scale
        if last.distances is not None and now.distances is not None:
            deltas = [
                new - old if scale.wrap is None else math.remainder(new - old, scale.wrap)
                for old, new in zip(last.distances, now.distances, strict=True)
            ]
        elif now.speeds is not None:
            deltas = [speed * elapsed for speed in now.speeds]
        else:
            return None
        if max(map(abs, deltas)) > 1.5 * self._fastest * elapsed + SPARE:
            return None
        return self.scaled((deltas[0], deltas[1]))

    def _turned(
        self, sides: tuple[float, float], last: Feedback, now: Feedback, at: float, elapsed: float
    ) -> float:
        """Return the change of heading (rad), from the best source that the base has."""
        rate = _gyro(now)
        if rate is not None:
            return self._by_gyro(rate, elapsed, at, now)
        if now.yaw is not None and last.yaw is not None:
            return wrap_angle(now.yaw - last.yaw) * self._scale.gyro
        return (sides[1] - sides[0]) / self._scale.track

    def _by_gyro(self, rate: float, elapsed: float, at: float, now: Feedback) -> float:
        """Return the change of heading (rad) by the gyro; at standstill, learn its bias."""
        stands = at - self._stepped_at > STANDS_AFTER and _still(now)
        off = self.level(rate)
        if stands and abs(off) < TURNED_BY_HAND:
            self._lessons += 1
            self.bias += max(LEARN, 1 / self._lessons) * off  # the first measurements are averaged
            return 0.0
        return off * elapsed

    def _move(self, distance: float, turned: float, elapsed: float, *, by_gyro: bool) -> None:
        """Advance the pose by the chord of an arc, and increase the uncertainty."""
        middle = self.yaw + turned / 2
        self.x += distance * math.cos(middle)
        self.y += distance * math.sin(middle)
        self.yaw = wrap_angle(self.yaw + turned)
        doubt = DRIFT * elapsed if by_gyro else SLIP_TURN * abs(turned)
        self._position_variance += (SLIP * distance) ** 2 + distance * distance * self._heading_variance
        self._heading_variance += doubt * doubt


def _gyro(feedback: Feedback) -> float | None:
    """Return the raw yaw rate, rad/s."""
    return None if feedback.gyro is None else feedback.gyro.z


def _still(feedback: Feedback) -> bool:
    """Return True when the base reports that its wheels stand, or reports no speeds."""
    return feedback.speeds is None or max(map(abs, feedback.speeds)) < 0.005


def _is_reset(last: Feedback, now: Feedback) -> bool:
    """Return True when both counters fell back to about zero."""
    if last.distances is None or now.distances is None:
        return False
    small = max(map(abs, now.distances)) <= FRESH
    return small and max(map(abs, last.distances)) > max(map(abs, now.distances)) + SPARE
