"""What drives have in common that damp by themselves: they let a dog down without targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TypeVar

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.drives.asking import Requester
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.group import DriveGroup, HeardDrive
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.description import DogDescription


@dataclass(slots=True)
class DampingDrive(HeardDrive):
    """One drive that damps by itself.

    ``wanted``: enabled, stopping (damping) or disabled. ``held``: it obeyed since one of the first two.
    """

    bus: CanBus
    id: int
    units: Units
    _: KW_ONLY
    wanted: Power = Power.DISABLED
    held: bool = False

    @property
    def obeying(self) -> Power:
        """What the drive is doing while it has torque: it is not off before it says so."""
        return Power.ENABLED if self.wanted is Power.ENABLED else Power.STOPPING

    def note_hold(self, *, obeys: bool, let_go: bool) -> None:
        """Notice a drive that lets go although nobody told it to: what was set in it is not trusted then."""
        if self.wanted is Power.DISABLED:
            self.held = False
        elif obeys:
            self.held = True
        elif let_go and self.held:
            self.restarted = True

    def let_go_as(self, said: str) -> str:
        """Return the fault of a drive that let go by itself, with what it said."""
        return f"id {self.id} let go by itself ({said}); it is configured again after a reset"


DampingT = TypeVar("DampingT", bound=DampingDrive)


class DampingGroup(DriveGroup[DampingT], ABC):
    """Drives of one dog that damp by themselves; a protocol adds the rest of ``JointDrive``."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], drives: Sequence[DampingT]) -> None:
        super().__init__(dog, buses, drives)
        self._requester = Requester(buses, self.take)
        self._wanted = Power.DISABLED
        self._most: float | None = None  # N m of a joint

    @abstractmethod
    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""

    @abstractmethod
    def damp(self, kd: float) -> None:
        """Let all joints give way slowly (N m s/rad). A drive without torque stays so, and answers."""

    def limit_torque(self, torque: float | None) -> None:
        """Note the limit (N m of a joint); commands to the drives heed it."""
        self._most = torque

    def braking(self) -> str:
        """Return nothing: a drive that has torque obeys."""
        return ""

    def probe(self, kd: float) -> bool:
        """Ask all drives; what holds a dog gives way, since its own watchdog would let it drop."""
        self.damp(kd)
        return True

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - damping needs no targets
        """Give way with damping."""
        self.damp(kd)

    def quick_stop(self) -> None:
        """Damp as the description says: what protocols call an emergency stop takes the torque off."""
        self.damp(self._dog.safety.kd)

    def _want(self, wanted: Power) -> None:
        """Note what is wanted of the drives."""
        self._wanted = wanted
        for drive in self._drives:
            drive.wanted = wanted
