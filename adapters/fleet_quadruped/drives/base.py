"""Interface of the body controller to the joint drives, independent of their protocol.

A new protocol is one module with a class like this and an entry point; see ``fleet_quadruped.drives``.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from fleet import CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.robot.joint import Joint


class Power(enum.StrEnum):
    """State of a drive, as reported."""

    ABSENT = "absent"  # never heard
    DISABLED = "disabled"  # no torque
    STARTING = "starting"  # on its way to enabled
    ENABLED = "enabled"  # follows targets
    STOPPING = "stopping"  # brakes, holds or damps, ignores targets
    FAULT = "fault"


HOLDING = frozenset({Power.ENABLED, Power.STOPPING})
"""States in which a drive may carry the robot: taking the torque off would drop it."""


NEVER = -math.inf
"""Time stamp (monotonic s) of a drive that has never answered: its age is infinite."""


class JointFeedback(NamedTuple):
    """Last feedback of one joint: rad, rad/s, N m of the joint; ``age`` in seconds.

    ``fault`` names the object and its content, empty without a fault. Temperature in degrees C. ``voltage``:
    V of the drive's supply, if it reports it. ``restarted``: the drive has lost its configuration.
    """

    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    power: Power = Power.ABSENT
    age: float = float("inf")
    temperature: float | None = None
    fault: str = ""
    voltage: float | None = None
    restarted: bool = False


class JointsFeedback(NamedTuple):
    """Feedback of all joints, value by value; see ``JointFeedback``."""

    angles: tuple[float, ...]
    speeds: tuple[float, ...]
    torques: tuple[float, ...]
    powers: tuple[Power, ...]
    ages: tuple[float, ...]
    temperatures: tuple[float | None, ...]
    faults: tuple[str, ...]
    voltages: tuple[float | None, ...]
    restarted: tuple[bool, ...]

    @classmethod
    def of(cls, feedback: Sequence[JointFeedback]) -> JointsFeedback:
        """Return the feedback of these joints."""
        return cls(*zip(*feedback, strict=True))

    @property
    def all_enabled(self) -> bool:
        """True if all drives follow targets."""
        return self.powers.count(Power.ENABLED) == len(self.powers)

    def each(self) -> tuple[JointFeedback, ...]:
        """Return the feedback joint by joint."""
        return tuple(map(JointFeedback._make, zip(*self, strict=True)))


class JointDrive(Protocol):
    """Drives of one robot, usually all twelve, on one or more buses.

    The static methods of the class are in ``fleet_quadruped.drives.Kind``. Only ``configure`` and
    ``limit_torque`` block, and neither takes the torque off drives that hold a robot. ``enable``, ``lower``,
    ``damp``, ``quick_stop`` and ``disable`` write one round of frames; they are called in each cycle until
    ``feedback`` shows that all drives did it.
    """

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Identifiers of the frames with targets for these drives; only one controller may send them."""

    def configure(self) -> None:
        """Bring every drive into the state of the description, and verify it by reading back.

        May be repeated. Raises LinkLost for a drive that does not answer, LinkRefused with joint, object,
        expected and actual value for a wrong one.
        """

    def limit_torque(self, torque: float | None) -> None:
        """Limit the torque of every joint (N m of the joint); None: as before. For drives that are off.

        Raises LinkRefused for a drive without such a limit.
        """

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a frame received at ``now`` (monotonic s); frames of others are ignored."""

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return joint and target (rad) of a frame that we sent; None for a frame without a target."""

    def begin_cycle(self, now: float) -> None:
        """Begin a cycle: request feedback (SYNC) and feed the drives' watchdogs."""

    def complete(self) -> bool:
        """Return True once all drives have answered since ``begin_cycle``."""

    def feedback(self, now: float) -> JointsFeedback:
        """Return the last feedback of the joints."""

    def enable(self) -> None:
        """Take one step towards enabled, at the measured position, without force."""

    def write(self, targets: Targets) -> None:
        """Send targets to all drives."""

    def braking(self) -> str:
        """Return a joint stopped by its drive's own means, which ignores targets; empty without one."""

    def probe(self, kd: float) -> bool:
        """Make drives report that only answer commands, without dropping a robot that they hold.

        A drive that holds the robot goes on, or damps it down slowly (N m s/rad). Returns True for drives
        that damp.
        """

    def lower(self, targets: Targets, kd: float) -> None:
        """Lower the robot: damp all joints (N m s/rad), or follow the targets if the drives cannot damp."""

    def damp(self, kd: float) -> None:
        """Damp all joints (N m s/rad); drives that cannot damp brake and hold."""

    def quick_stop(self) -> None:
        """Brake all joints by the drives' own means."""

    def disable(self) -> None:
        """Take the torque off."""

    def reset_fault(self) -> None:
        """Acknowledge faults; only at the request of a person."""
