"""Can a vehicle on the surface turn in place? Determined from ArduRover's servo functions."""

from __future__ import annotations

from collections.abc import Iterable

from fleet import CommandError
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_OUTPUTS = tuple(f"SERVO{number}_FUNCTION" for number in range(1, 5))
_STEERED = 26  # ground steering
_TURNING = frozenset({73, 74, 33, 34, 35, 36})  # throttle left and right; motors of an omni frame
_FOREVER, _AGAIN = 3600.0, 10.0  # s


class SteeringSettings:
    """Steering of one vehicle, read at each connect and after each reboot."""

    def __init__(self, vehicle: Vehicle, parameters: Parameters) -> None:
        self._vehicle = vehicle
        self._parameters = parameters

    async def run(self) -> None:
        """Read the servo functions of a vehicle on the surface, again after each reboot, until cancelled."""
        vehicle = self._vehicle
        while True:
            while not await vehicle.until(self._is_met, _FOREVER):
                vehicle.log.debug("no rover or boat is connected")
            reboots, wait = vehicle.state.reboots, _FOREVER
            try:
                found = await self._parameters.read(_OUTPUTS)
            except CommandError as error:
                vehicle.log.info("its steering could not be read: %s", error)
                wait = _AGAIN if error.device_result is None else _FOREVER
            else:
                vehicle.turns_in_place = turns_in_place(int(each.value) for each in found)
            await vehicle.restarted(reboots, wait)

    def _is_met(self, state: VehicleState) -> bool:
        """Return True while it answers, and moves on the surface."""
        return state.on_the_surface and self._vehicle.connected and self._vehicle.flavour is not None


def turns_in_place(functions: Iterable[int]) -> bool | None:
    """Return whether a vehicle with these servo functions can turn in place, None: unknown."""
    had = frozenset(functions)
    if had & _TURNING:
        return True
    return False if _STEERED in had else None
