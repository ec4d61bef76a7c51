"""Kind of a vehicle, whether it is moved here or not: its modes, and how it is braked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import msgspec

from fleet_mavlink.messages import Ask
from fleet_mavlink.state import VehicleState


class Brake(msgspec.Struct, frozen=True):
    """One way to brake: the command, and the mode that the heartbeat shows once it was obeyed.

    ``first``: what must be taken before it, or it does not brake.
    """

    mode: str
    ask: Ask
    first: Brake | None = None

    @property
    def asks(self) -> tuple[Ask, ...]:
        """The commands, in order."""
        return (*(self.first.asks if self.first else ()), self.ask)

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes that may be shown on the way, and at its end."""
        return (*(self.first.modes if self.first else ()), self.mode)


class VehicleKind(ABC):
    """One kind of vehicle on one autopilot. Modes are given by name; ``modes`` has their numbers."""

    name: ClassVar[str]  # of the autopilot
    modes: ClassVar[Mapping[int, str]]
    rates: ClassVar[Mapping[int, float]]  # message id -> Hz, besides those asked of every autopilot
    imu: ClassVar[int | None]  # the message with rates and acceleration
    motors: ClassVar[int | None]  # the message with the motors' speeds
    data_streams: ClassVar[tuple[int, ...]]  # for REQUEST_DATA_STREAM, empty where it is not obeyed
    bytewise_parameters: ClassVar[bool]  # integers are sent as their bits, not as a number
    may_be_disarmed: ClassVar[bool] = False  # to switch its motors off lets nothing fall
    goes_over: ClassVar[bool] = False  # to its wings: it has braked when it is seen to hover again

    def mode_name(self, custom_mode: int) -> str:
        """Return the name of a mode, or its number when it has none here."""
        return self.modes.get(custom_mode, f"MODE({custom_mode:#x})")

    def mode_of(self, state: VehicleState) -> str:
        """Return the mode that the newest heartbeat shows, empty before the first."""
        return self.mode_name(state.heartbeat.custom_mode) if state.heartbeat else ""

    def number_of(self, mode: str) -> int:
        """Return the custom_mode of a mode that ``modes`` names."""
        return next(number for number, name in self.modes.items() if name == mode)

    @abstractmethod
    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the ways to brake it, the best first; the next is tried when one is refused."""

    def brake_modes(self, state: VehicleState) -> tuple[str, ...]:
        """Return the modes that may be shown while it is braked, or tried to be."""
        return tuple(mode for brake in self.brakes(state) for mode in brake.modes)

    def stands(self, state: VehicleState) -> bool:  # noqa: ARG002 - a VTOL's depends on it
        """Return whether it stands still once it has braked: wings cannot."""
        return True

    @abstractmethod
    def position_usable(self, state: VehicleState, now: float) -> bool | None:
        """Return whether the estimator's position can be moved by, None while it says nothing of it."""

    @abstractmethod
    def ready_to_arm(self, state: VehicleState) -> bool | None:
        """Return whether arming would work now, None while that is unknown."""
