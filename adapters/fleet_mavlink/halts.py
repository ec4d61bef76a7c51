"""Halts of a vehicle: messages that stop it at once, written from any thread."""

from __future__ import annotations

from collections.abc import Callable

from fleet import LinkLost, Refused, Vector3
from fleet_mavlink.authority import Authority
from fleet_mavlink.braking import Brakes
from fleet_mavlink.commander import Commander
from fleet_mavlink.flavour import ned_setpoint
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.motion_effect import EMERGENCY_HALTED, HALTED
from fleet_mavlink.vehicle import Vehicle, holding_of
from fleet_mavlink.velocity_stream import VelocityStream


class Halts:
    """Writes halts to one vehicle; ``comes_down`` returns whether it shows that it lands, or flies home."""

    def __init__(
        self,
        vehicle: Vehicle,
        hub: LinkHub,
        *,
        commander: Commander,
        authority: Authority,
        driver: VelocityStream,
        brakes: Brakes,
        comes_down: Callable[[], bool],
    ) -> None:
        self._vehicle = vehicle
        self._hub = hub
        self._commander = commander
        self._authority = authority
        self._driver = driver
        self._brakes = brakes
        self._comes_down = comes_down

    def halt(self, *, requested: bool = False, takes_over: bool = False) -> bool:
        """Write the messages that stop the vehicle now; from any thread. The next tick continues from there.

        Requested motion that is not confirmed yet is not requested again. ``requested``: a sender wants this
        stop. Otherwise the mode of a vehicle that does not answer is not changed, because it may be in its
        own fail-safe, and one that comes down is left alone. One under another operator's control is left
        alone unless ``takes_over``, which implies ``requested``. Returns False if nothing was written; raises
        LinkLost.
        """
        requested = requested or takes_over
        self._commander.turns.halt(EMERGENCY_HALTED if requested else HALTED)
        self._driver.halted = True
        taken = self._vehicle.flavour is not None and self._authority.lost_to and not takes_over
        if taken or (self._comes_down() and not requested):
            return False
        return self._hub.send_from_any_thread(self._halting(requested=requested), self._vehicle)

    def _halting(self, *, requested: bool) -> list[MavlinkMessage]:
        """Return the messages that stop the vehicle, none for one on the ground.

        A silent one may have been armed since its last message, and may still receive.
        """
        vehicle, flavour = self._vehicle, self._vehicle.flavour
        heard = vehicle.connected
        if not vehicle.state.armed and (heard or not requested):
            return []
        if flavour is None:
            return [*self._brakes.messages()] if heard or requested else []
        streamed = flavour.mode_of(vehicle.state) == flavour.external and not flavour.tries_brakes
        messages: list[MavlinkMessage] = [ned_setpoint(Vector3(), 0.0, vehicle.system)] * streamed
        # Zero alone is not enough: PX4 descends when the setpoints of a stuck process end.
        best = holding_of(vehicle) if heard or requested else None
        if best is not None:
            pending = self._commander.turns.current
            goes_on = pending is not None and not pending.superseded  # a landing, about to change the mode
            (self._authority.expect_also if goes_on else self._authority.expect)(*best.modes)
            self._commander.mode_is_requested(best.mode)
            messages += map(self._commander.addressed, best.requests)
        return messages

    def write(self, *, takes_over: bool) -> None:
        """Write a requested stop to a vehicle that may be silent; from any thread.

        Raises Refused with the reason if it is not written, LinkLost if the link does not take it.
        """
        require_ours(self._authority, takes_over=takes_over)
        if self._vehicle.connected and not self._vehicle.state.armed:
            raise Refused("its motors are off")
        if not self.halt(requested=True, takes_over=takes_over):
            raise LinkLost(f"the vehicle's address on {self._hub.link.url} is not known yet: it sent nothing")


def require_ours(authority: Authority, *, takes_over: bool) -> None:
    """Raise Refused if a plain stop would take a vehicle from its pilot or its fail-safe."""
    if authority.lost_to and not takes_over:
        raise Refused(
            f"a pilot or a fail-safe has it, in {authority.taker}: it was left to that",
            hint="hover, brake and emergency_stop take it",
        )
