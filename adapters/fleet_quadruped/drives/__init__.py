"""Joint drives: one interface over the protocols that they speak. A protocol is a module and a row here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from fleet_quadruped.can.frame import CanBus
from fleet_quadruped.drives.base import JointDrive
from fleet_quadruped.drives.cia402.drive import Cia402Drives
from fleet_quadruped.drives.mit.drive import MitDrives
from fleet_quadruped.robot.description import DogDescription, Joint
from fleet_quadruped.robot.parts import Drive


class Kind(Protocol):
    """A class of drives."""

    def __call__(
        self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint], /
    ) -> JointDrive:
        """Return the drives of these joints."""

    def problem(self, drive: Drive, /) -> str:
        """Return what is wrong with the section ``drive`` of a description, empty when nothing is."""

    def bits(self, drive: Drive, joints: int, /) -> float:
        """Return the bits a second that so many joints put on a bus."""

    def identifiers(self, drive: Drive, number: int, /) -> tuple[int, ...]:
        """Return the frames that a drive with this id says and hears; 0: those that are for all."""

    def farthest(self, joint: Joint, drive: Drive, /) -> float:
        """Return the greatest angle that its frames can say, rad of the motor."""


PROTOCOLS: Mapping[str, Kind] = MappingProxyType({"cia402": Cia402Drives, "mit": MitDrives})


def drives_of(
    dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint] | None = None
) -> JointDrive:
    """Return the drives of a dog, or of some of its joints, not yet configured."""
    return PROTOCOLS[dog.drive.protocol](dog, buses, dog.all_joints if joints is None else joints)
