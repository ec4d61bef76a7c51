"""When an edge that has taken the lease over may move a robot: not before the last motion has ended. Pure."""

from __future__ import annotations

import msgspec

from fleet.standby.lease import Takeover, Terms


class Bound(msgspec.Struct, frozen=True):
    """How long a robot may go on moving after its edge was heard for the last time, s.

    ``setpoint_lease``: for which the edge holds a velocity; ``failsafe``: in which the robot's own fail-safe
    ends motion that nobody commands any more, None where nobody knows of one.
    """

    setpoint_lease: float
    failsafe: float | None

    def after(self, lease: float) -> float | None:
        """Return the seconds from the last sign of the lease's holder; None: only a stop ends its motion."""
        return None if self.failsafe is None else lease + self.setpoint_lease + self.failsafe


def motion_from(bound: Bound, takeover: Takeover, terms: Terms) -> float | None:
    """Return when the robot may be moved (s, as the takeover's); None: once it has been stopped from here.

    A holder that let go of its robots in order was not heard for the whole length of the lease: only what the
    robot itself does is waited for then.
    """
    after = bound.after(0.0 if takeover.orderly else terms.length)
    return None if after is None else takeover.since + after
