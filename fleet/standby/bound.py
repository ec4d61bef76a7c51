"""When an edge that has taken over may move a robot: not before the last motion has ended. Pure."""

from __future__ import annotations

import msgspec

from fleet.standby.lease import LeaseTimes, Takeover


class MotionBound(msgspec.Struct, frozen=True):
    """Time for which a robot may continue to move after its edge's last message, s.

    ``setpoint_lease``: for which the edge holds a velocity; ``failsafe``: within which the robot's own
    fail-safe ends motion without commands, None if there is none known.
    """

    setpoint_lease: float
    failsafe: float | None

    def after(self, lease: float) -> float | None:
        """Return the seconds from the last sign of the lease's holder; None: only a stop ends its motion."""
        return None if self.failsafe is None else lease + self.setpoint_lease + self.failsafe


def motion_from(bound: MotionBound, takeover: Takeover, terms: LeaseTimes) -> float | None:
    """Return when the robot may be moved (s, as the takeover's); None: only after a stop from here.

    A holder that released its robots in order was not silent for the whole lease: then only the robot's own
    bound applies.
    """
    after = bound.after(0.0 if takeover.orderly else terms.length)
    return None if after is None else takeover.since + after
