"""Health of one vehicle and its link, with the cause."""

from __future__ import annotations

from collections.abc import Callable

from fleet import Health, Level, Robot
from fleet_mavlink.authentication import FALSE, UNSIGNED
from fleet_mavlink.failsafe_causes import FailsafeCause, position_troubles
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.state import SILENCE
from fleet_mavlink.vehicle import Vehicle


class VehicleHealth:
    """Reports the vehicle's health to the host. ``troubles`` returns those of fail-safe settings and fence.

    ``unstopped`` is the reason why the last stop failed, else empty; ``cause`` is the reason of a fail-safe,
    taken from the autopilot's texts.
    """

    def __init__(
        self, vehicle: Vehicle, hub: LinkHub, robot: Robot, troubles: Callable[[], tuple[str, ...]]
    ) -> None:
        self.unstopped = ""
        self.cause = FailsafeCause()
        self._vehicle = vehicle
        self._hub = hub
        self._robot = robot
        self._settings_troubles = troubles
        self._began = robot.clock.monotonic()

    def check(self) -> None:
        """Check the vehicle's timeouts, and report its health once it has had time to answer."""
        self._vehicle.tick()
        self.find_failsafe_cause()
        never_heard = self._vehicle.state.heartbeat is None
        if never_heard and self._robot.clock.monotonic() - self._began < SILENCE:
            return
        self.report()

    def report(self) -> None:
        """Report the health now."""
        self._robot.health(self._health())

    def find_failsafe_cause(self) -> None:
        """Look for the reason of a fail-safe in the autopilot's texts."""
        vehicle = self._vehicle
        if vehicle.kind is not None:
            mode = vehicle.kind.mode_of(vehicle.state)
            self.cause.observe(vehicle.state, mode, vehicle.sentences, vehicle.now())

    def _health(self) -> Health:
        """Return the vehicle's health, with the cause."""
        vehicle = self._vehicle
        if not vehicle.connected:
            return Health(Level.OFFLINE, self._absence())
        if vehicle.clashing:
            return Health(Level.FAULT, f"two vehicles use system id {vehicle.system}: give each its own")
        troubles = self._troubles()
        return Health(Level.DEGRADED, "; ".join(troubles)) if troubles else Health()

    def _troubles(self) -> tuple[str, ...]:
        """Return the problems of a vehicle that answers."""
        vehicle = self._vehicle
        troubles = position_troubles(vehicle.state, vehicle.now())
        if self.unstopped and vehicle.state.armed:
            troubles = (self.unstopped, *troubles)
        if vehicle.state.failsafe:
            why = self.cause.text
            return (f"the autopilot is in a fail-safe{': ' if why else ''}{why}", *troubles)
        if vehicle.flavour is None:
            return (f"{vehicle.what}: watched and stopped, not moved", *troubles)
        if vehicle.trust.signer is not None and not vehicle.trust.signed:
            troubles = (f"system {vehicle.system} does not sign: send setup_signing", *troubles)
        return (*troubles, *self._settings_troubles())

    def _absence(self) -> str:
        """Return which system is silent, and which others are received instead."""
        system = self._vehicle.system
        where = f"system {system} on {self._hub.link.url}"
        others = [str(each) for each in self._hub.unclaimed]
        hint = f"; received system {', '.join(others)} instead: check system_id" if others else ""
        if self._vehicle.state.heartbeat is not None:
            return f"no heartbeat from {where} for {SILENCE:g} s{hint}"
        refused = [why for why in (UNSIGNED, FALSE) if self._vehicle.trust.counts[why]]
        if refused:
            return f"{where} sends {refused[0]}: see signing_key, accept_unsigned"
        return f"no heartbeat from {where} yet{hint}"
