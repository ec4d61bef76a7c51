"""Kind of a vehicle, whether it is moved here or not: its modes, and its brakes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import msgspec

from fleet_mavlink.messages import MavlinkCommand
from fleet_mavlink.state import VehicleState

if TYPE_CHECKING:
    from fleet_mavlink.flavour import Flavour

_SLOWED = 0.7  # share of the first speed


class Brake(msgspec.Struct, frozen=True):
    """One way to brake: the command, and the mode that the heartbeat shows once it was executed.

    ``first``: brake that must be accepted before it, or it has no effect.
    """

    mode: str
    request: MavlinkCommand
    first: Brake | None = None

    @property
    def requests(self) -> tuple[MavlinkCommand, ...]:
        """The commands, in order."""
        return (*(self.first.requests if self.first else ()), self.request)

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes that may be shown in between, and at the end."""
        return (*(self.first.modes if self.first else ()), self.mode)


class VehicleKind(ABC):
    """One kind of vehicle on one autopilot. Modes are given by name; ``modes`` has their numbers."""

    name: ClassVar[str]  # of the autopilot
    modes: ClassVar[Mapping[int, str]]
    rates: ClassVar[Mapping[int, float]]  # message id -> Hz, in addition to those for every autopilot
    imu: ClassVar[int | None]  # message with rates and acceleration
    motors: ClassVar[int | None]  # message with the motors' speeds
    data_streams: ClassVar[tuple[int, ...]]  # for REQUEST_DATA_STREAM, empty if it is not accepted
    bytewise_parameters: ClassVar[bool]  # integers are sent as their bits, not as a number
    may_be_disarmed: ClassVar[bool] = False  # switching its motors off is safe
    goes_over: ClassVar[bool] = False  # in transition to its wings: it has braked once it hovers again

    @property
    def flavour(self) -> Flavour | None:
        """Itself if such a vehicle is moved here, else None."""
        return None

    def mode_name(self, custom_mode: int) -> str:
        """Return the name of a mode, or its number if it has no name here."""
        return self.modes.get(custom_mode, f"MODE({custom_mode:#x})")

    def mode_of(self, state: VehicleState) -> str:
        """Return the mode in the newest heartbeat, empty before the first."""
        return self.mode_name(state.heartbeat.custom_mode) if state.heartbeat else ""

    def number_of(self, mode: str) -> int:
        """Return the custom_mode of a mode in ``modes``."""
        return next(number for number, name in self.modes.items() if name == mode)

    @abstractmethod
    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the ways to brake it, the best first; the next is tried if one is refused."""

    def brake_modes(self, state: VehicleState) -> tuple[str, ...]:
        """Return the modes that may be shown during braking."""
        return tuple(mode for brake in self.brakes(state) for mode in brake.modes)

    def stands(self, state: VehicleState) -> bool:  # noqa: ARG002 - VTOLs need it
        """Return whether it stands still once it has braked: planes cannot."""
        return True

    def slows_to(self, speed: float) -> float:
        """Return the speed, m/s, below which a vehicle that was stopped at ``speed`` is slowing down."""
        return _SLOWED * speed

    @abstractmethod
    def position_usable(self, state: VehicleState, now: float) -> bool | None:
        """Return whether the position estimate is good enough for moving, None while unknown."""

    @abstractmethod
    def ready_to_arm(self, state: VehicleState) -> bool | None:
        """Return whether arming would succeed now, None while unknown."""
