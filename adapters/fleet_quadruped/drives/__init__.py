"""Joint drives: one interface over their protocols. A protocol is an entry point of a package.

Group ``fleet.quadruped_drives``: the name in ``drive.protocol``, and a class like ``DriveKind``.
Group ``fleet.quadruped_simulated_drives``: the same name, and a class like ``sim.drive.AnyDrive``.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Protocol, cast

from fleet import CanBus, ConfigError
from fleet_quadruped.drives.base import JointDrive
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import CanBusConfig, Drive

if TYPE_CHECKING:
    from fleet_quadruped.robot.description import DogDescription  # it is validated with the drives

DRIVES = "fleet.quadruped_drives"
SIMULATED_DRIVES = "fleet.quadruped_simulated_drives"
_REQUESTED = ("problems", "load", "shared", "identifiers", "farthest")
"""Static methods of the class, needed before a bus is open."""


class DriveKind(Protocol):
    """A class of drives for one protocol."""

    def __call__(
        self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint], /
    ) -> JointDrive:
        """Return the drives of these joints."""

    def problems(self, dog: DogDescription, /) -> list[str]:
        """Return all settings in a description that these drives do not support, each with its place."""

    def load(self, drive: Drive, joints: int, bus: CanBusConfig, /) -> float:
        """Return the load of a bus with this number of joints, as a share."""

    def shared(self, dog: DogDescription, /) -> tuple[int, ...]:
        """Return the identifiers shared by all drives."""

    def identifiers(self, drive: Drive, joint: Joint, /) -> tuple[int, ...]:
        """Return the identifiers that one drive sends and receives."""

    def farthest(self, joint: Joint, drive: Drive, /) -> float:
        """Return the largest angle that its frames can represent, rad of the motor."""


@functools.cache
def drive_kind(protocol: str) -> DriveKind:
    """Return the drives for a protocol; raises ConfigError with the known protocols."""
    kind = load_entry(DRIVES, protocol)
    missing = [name for name in _REQUESTED if not callable(getattr(kind, name, None))]
    if missing or not callable(kind):
        raise ConfigError(f"{protocol!r} is not a class of joint drives: it has no {', '.join(missing)}")
    return cast("DriveKind", kind)


def load_entry(group: str, name: str) -> Any:
    """Return the object of an entry point; raises ConfigError if it is missing, ambiguous or broken."""
    points = entry_points(group=group)
    found = points.select(name=name)
    if not found:
        known = ", ".join(sorted(points.names)) or "none; reinstall zenoh-fleet"
        raise ConfigError(f"there is no {name!r}; there are {known}")
    if len({point.value for point in found}) > 1:
        places = ", ".join(sorted(point.value for point in found))
        raise ConfigError(f"{name!r} is there more than once ({places}); remove all packages but one")
    try:
        return next(iter(found)).load()
    except Exception as error:
        value = next(iter(found)).value
        raise ConfigError(f"{name!r} ({value}) cannot be loaded: {type(error).__name__}: {error}") from error


def drives_of(
    dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint] | None = None
) -> JointDrive:
    """Return the drives of a robot, or of some of its joints, not configured yet."""
    return drive_kind(dog.drive.protocol)(dog, buses, dog.all_joints if joints is None else joints)
