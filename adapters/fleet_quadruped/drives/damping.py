"""Shared part of drives that damp by themselves: they lower a robot without targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TypeVar

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.group import DriveGroup, ReportingDrive
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.description import DogDescription


@dataclass(slots=True)
class DampingDrive(ReportingDrive):
    """One drive that can damp by itself.

    ``wanted``: enabled, stopping (damping) or disabled. ``held``: it has followed one of the first two.
    """

    bus: CanBus
    id: int
    units: Units
    _: KW_ONLY
    wanted: Power = Power.DISABLED
    held: bool = False

    @property
    def obeying(self) -> Power:
        """State of the drive while it has torque: it counts as on until it reports that it is off."""
        return Power.ENABLED if self.wanted is Power.ENABLED else Power.STOPPING

    def note_hold(self, *, obeys: bool, torque_off: bool) -> None:
        """Detect a drive that took its torque off without a command; its configuration is not valid then."""
        if self.wanted is Power.DISABLED:
            self.held = False
        elif obeys:
            self.held = True
        elif torque_off and self.held:
            self.restarted = True

    def torque_off_fault(self, said: str) -> str:
        """Return the fault of a drive that took its torque off by itself, with its report."""
        return f"id {self.id} switched its torque off ({said}); it is configured again after a reset"


DampingT = TypeVar("DampingT", bound=DampingDrive)


class DampingGroup(DriveGroup[DampingT], ABC):
    """Drives of one robot that damp by themselves; a protocol adds the rest of ``JointDrive``."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], drives: Sequence[DampingT]) -> None:
        super().__init__(dog, buses, drives)
        self._requester = DriveRequester(buses, self.handle_frame)
        self._wanted = Power.DISABLED
        self._most: float | None = None  # torque limit, N m of a joint

    @abstractmethod
    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""

    @abstractmethod
    def damp(self, kd: float) -> None:
        """Damp all joints (N m s/rad). A drive without torque stays so, and answers."""

    def limit_torque(self, torque: float | None) -> None:
        """Set the limit (N m of a joint), which later commands respect."""
        self._most = torque

    def braking(self) -> str:
        """Return "": a drive with torque follows its commands."""
        return ""

    def probe(self, kd: float) -> bool:
        """Poll all drives; one that holds the robot damps, since its own watchdog would let it drop."""
        self.damp(kd)
        return True

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - damping needs no targets
        """Damp all joints."""
        self.damp(kd)

    def quick_stop(self) -> None:
        """Damp as in the description: the protocols' emergency stops would take the torque off."""
        self.damp(self._dog.safety.kd)

    def _want(self, wanted: Power) -> None:
        """Set the state that the drives should have."""
        self._wanted = wanted
        for drive in self._drives:
            drive.wanted = wanted
