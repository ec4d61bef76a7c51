"""What the body controller asks of twelve joint drives, whatever their protocol.

Adding a protocol is one module with a class like this and an entry point; see ``fleet_quadruped.drives``.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from fleet import CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.robot.description import Joint


class Power(enum.StrEnum):
    """What a drive says of itself."""

    ABSENT = "absent"  # never heard
    DISABLED = "disabled"  # no torque
    STARTING = "starting"  # on the way to enabled
    ENABLED = "enabled"  # obeys targets
    STOPPING = "stopping"  # brakes, holds or damps, obeys no targets
    FAULT = "fault"


HOLDING = frozenset({Power.ENABLED, Power.STOPPING})
"""What a drive says whose joint may carry the dog: taking the torque off would drop it."""


NEVER = -math.inf
"""When a drive was heard that was not heard yet (monotonic s): ages of it are infinite."""


class JointFeedback(NamedTuple):
    """One joint as its drive last told: rad, rad/s, N m of the joint; ``age`` in seconds.

    ``fault`` names the object and what it says, empty without a fault. Temperature in degrees C.
    ``voltage``: V on the drive's own supply, where it tells it.
    ``restarted``: the drive has forgotten how it was configured.
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


class Joints(NamedTuple):
    """What all joints of a dog tell, value by value; see ``JointFeedback``."""

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
    def of(cls, told: Sequence[JointFeedback]) -> Joints:
        """Return what these joints tell."""
        return cls(*zip(*told, strict=True))

    @property
    def all_enabled(self) -> bool:
        """True when all obey targets."""
        return self.powers.count(Power.ENABLED) == len(self.powers)

    def each(self) -> tuple[JointFeedback, ...]:
        """Return the same joint by joint."""
        return tuple(map(JointFeedback._make, zip(*self, strict=True)))


class JointDrive(Protocol):
    """Drives of one dog, mostly all twelve, on one or more buses.

    What their class is asked before there is a bus is in ``fleet_quadruped.drives.Kind``. No method blocks
    but ``configure`` and ``limit_torque``, and neither takes the torque off drives that hold a dog.
    ``enable``, ``lower``, ``damp``, ``quick_stop`` and ``disable`` write one round of frames; they are
    called in each cycle until ``feedback`` says that all drives did it.
    """

    @property
    def addresses(self) -> frozenset[Address]:
        """The frames that tell these drives where to go; only one controller may send them."""

    def configure(self) -> None:
        """Bring every drive into the state that the description wants and verify it by reading back.

        May be repeated. Raises LinkLost for a drive that does not answer, LinkRefused naming joint, object,
        wanted and actual for one that is wrong.
        """

    def limit_torque(self, torque: float | None) -> None:
        """Let no joint push harder than this (N m of the joint); None: as before. While the drives are off.

        Raises LinkRefused for a drive that cannot be limited.
        """

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a frame that was received at ``now`` (monotonic s); frames of others are ignored."""

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return which joint a frame of ours sends where (rad); None for any other frame."""

    def begin_cycle(self, now: float) -> None:
        """Begin a cycle: ask for feedback (SYNC) and keep the drives' watchdogs fed."""

    def complete(self) -> bool:
        """Return True when all drives have answered since ``begin_cycle``."""

    def feedback(self, now: float) -> Joints:
        """Return what is known of the joints."""

    def enable(self) -> None:
        """Go one step towards enabled, at the measured place, without force."""

    def write(self, targets: Targets) -> None:
        """Send targets to all drives."""

    def braking(self) -> str:
        """Return which joint is stopped by its drive's own means, and obeys no targets; empty without one."""

    def probe(self, kd: float) -> bool:
        """Make drives speak that only answer; what holds a dog goes on, or gives way slowly (N m s/rad).

        Returns True for drives that give way by it.
        """

    def lower(self, targets: Targets, kd: float) -> None:
        """Let the dog down: all joints give way slowly (N m s/rad), or go to the targets if they cannot."""

    def damp(self, kd: float) -> None:
        """Let all joints give way slowly (N m s/rad), or brake and hold them if they cannot."""

    def quick_stop(self) -> None:
        """Brake all joints by the drives' own means."""

    def disable(self) -> None:
        """Take the torque off."""

    def reset_fault(self) -> None:
        """Acknowledge faults; only when a person asked."""
