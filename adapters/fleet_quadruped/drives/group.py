"""Shared part of all protocols: the last feedback of one drive, and all drives of a robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from operator import attrgetter
from typing import Generic, TypeVar

from fleet import CanBus
from fleet_quadruped.drives.base import NEVER, JointsFeedback, Power
from fleet_quadruped.drives.drive_answers import DriveAnswers
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint


@dataclass(slots=True)
class ReportingDrive(ABC):
    """Last feedback of one drive: rad, rad/s, N m of the joint; degrees C; V; times in monotonic s.

    ``restarted``: it has lost its configuration, and is in fault until it is configured again.
    """

    joint: Joint
    _: KW_ONLY
    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    temperature: float | None = None
    voltage: float | None = None
    reported_at: float = NEVER
    answers: DriveAnswers = field(default_factory=DriveAnswers)
    restarted: bool = False

    @abstractmethod
    def power(self, now: float) -> tuple[Power, str]:
        """Return the state of the drive, and its fault; empty without one."""

    @property
    def duplicate_id_fault(self) -> str:
        """Fault text for two drives with the same id."""
        return f"two drives answer as id {self.joint.id} on bus {self.joint.bus}: give each its own"


ReportingT = TypeVar("ReportingT", bound=ReportingDrive)
_VALUES = attrgetter("angle", "speed", "torque", "reported_at", "temperature", "voltage", "restarted")


class DriveGroup(Generic[ReportingT]):
    """Drives of one robot; ``buses`` by name. A protocol adds the rest of ``JointDrive``."""

    def __init__(
        self, dog: DogDescription, buses: Mapping[str, CanBus], drives: Sequence[ReportingT]
    ) -> None:
        self._dog = dog
        self._buses = buses
        self._drives = drives

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:  # noqa: ARG004 - pydantic checks each key
        """Return no problems."""
        return []

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:  # noqa: ARG004 - some protocols need it
        """Return no identifiers: each drive has its own."""
        return ()

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - not needed here
        """Begin a cycle; the last cycle's commands already requested feedback."""
        for drive in self._drives:
            drive.answers.begin()

    def complete(self) -> bool:
        """Return True once each drive has answered."""
        return all(drive.answers.complete for drive in self._drives)

    def feedback(self, now: float) -> JointsFeedback:
        """Return the last feedback of the joints."""
        angles, speeds, torques, reported_at, temperatures, voltages, restarted = zip(
            *map(_VALUES, self._drives), strict=True
        )
        powers, faults = zip(*[drive.power(now) for drive in self._drives], strict=True)
        ages = tuple([now - at for at in reported_at])
        return JointsFeedback(
            angles, speeds, torques, powers, ages, temperatures, faults, voltages, restarted
        )
