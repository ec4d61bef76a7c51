"""Reads the parameters that a winged aircraft needs for moving; its state keeps their values."""

from __future__ import annotations

from fleet import CommandError
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_FOREVER, _AGAIN = 3600.0, 10.0  # s


class WingSettings:
    """Parameters of one vehicle, read at each connect and after each reboot."""

    def __init__(self, vehicle: Vehicle, parameters: Parameters) -> None:
        self._vehicle = vehicle
        self._parameters = parameters

    async def run(self) -> None:
        """Read the parameters of a vehicle with wings, again after each reboot, until cancelled."""
        vehicle = self._vehicle
        while True:
            while not await vehicle.until(self._is_met, _FOREVER):
                vehicle.log.debug("no winged vehicle is connected")
            before = vehicle.state.reboots, self._wanted
            for name in self._wanted:
                if name not in vehicle.state.settings:
                    await self._read(name)

            def is_another(state: VehicleState, before: tuple[int, tuple[str, ...]] = before) -> bool:
                return (state.reboots, self._wanted) != before

            await vehicle.until(is_another, _FOREVER if self._is_known else _AGAIN)

    @property
    def _is_known(self) -> bool:
        """Whether all are known; a lost answer looks like a missing parameter."""
        state = self._vehicle.state
        has_rotors = bool(state.vtol_state)
        return all(name in state.settings for name in self._wanted if has_rotors or not name.startswith("Q_"))

    @property
    def _wanted(self) -> tuple[str, ...]:
        """Parameters that it needs for moving."""
        flavour = self._vehicle.flavour
        return flavour.settings if flavour else ()

    async def _read(self, name: str) -> None:
        """Read one parameter."""
        try:
            await self._parameters.read([name])
        except CommandError as error:
            self._vehicle.log.info("%s is not known: %s", name, error)

    def _is_met(self, _state: VehicleState) -> bool:
        """Return True while it answers, and has wings."""
        return self._vehicle.connected and bool(self._wanted)
