"""Preconditions of commands to a vehicle; each raises an error with the reason and the remedy."""

from __future__ import annotations

import math

from fleet import GeoPoint, NotReady, Unsupported
from fleet_mavlink.authority import Authority
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle, missing_commands
from fleet_mavlink.vehicle import not_moved as not_moved_words

_SLOW = 0.5  # m/s; slower counts as standing


def require_heartbeat(vehicle: Vehicle) -> None:
    """Raise NotReady unless the vehicle answers."""
    if not vehicle.connected:
        raise _unheard(vehicle)


def require_connection(vehicle: Vehicle) -> None:
    """Raise NotReady unless the vehicle answers and is the only one with its id."""
    now = vehicle.now()
    if not vehicle.state.connected(now):
        raise _unheard(vehicle)
    if vehicle.clashed(now):
        raise NotReady(
            f"two vehicles use system id {vehicle.system}", hint="give each its own id and send this again"
        )


def _unheard(vehicle: Vehicle) -> NotReady:
    """Return the error for a vehicle that does not answer."""
    return NotReady(f"no heartbeat from system {vehicle.system}", hint="check the link and its power")


def require_control(vehicle: Vehicle, authority: Authority) -> None:
    """Raise NotReady unless the vehicle answers, is the only one with its id, and is ours.

    Raises Unsupported for a vehicle that is not moved here.
    """
    require_connection(vehicle)
    if vehicle.flavour is None:
        raise not_moved(vehicle)
    if authority.lost_to:
        raise NotReady(f"a pilot or a fail-safe has it, in {authority.taker}", hint="send hover to take it")


def require_movable(vehicle: Vehicle, authority: Authority) -> None:
    """Raise NotReady unless it flies (or is armed on the surface), is ours, and has a valid position."""
    require_control(vehicle, authority)
    state = vehicle.state
    if state.on_the_surface:
        if not state.armed:
            raise not_armed()
    elif not (state.armed and state.in_air):
        raise not_in_the_air()
    if not state.knows_where(vehicle.now()):
        raise NotReady("no position of the last second that can be trusted", hint="wait for satellites")


def moved_flavour(vehicle: Vehicle) -> Flavour:
    """Return its flavour; raises NotReady before a heartbeat, Unsupported if it is not moved here."""
    if vehicle.flavour is None:
        require_connection(vehicle)
        raise not_moved(vehicle)
    return vehicle.flavour


def is_standing(state: VehicleState) -> bool:
    """Return True while it does not move."""
    return state.speed <= _SLOW


def not_moved(vehicle: Vehicle) -> Unsupported:
    """Return the error for a vehicle that can be monitored and stopped here, but not moved."""
    beat = vehicle.state.heartbeat
    return Unsupported("its vehicle type is not known yet" if beat is None else not_moved_words(beat))


def require_has(vehicle: Vehicle, name: str) -> None:
    """Raise Unsupported for a command that this vehicle lacks."""
    if reason := missing_commands(vehicle.state).get(name):
        raise Unsupported(reason)


def known_position(vehicle: Vehicle) -> GeoPoint:
    """Return the vehicle's position (altitude AMSL); raises NotReady before the first."""
    position = vehicle.state.position
    if position is None:
        raise NotReady("position is unknown")
    return position


def known_heading(vehicle: Vehicle) -> float:
    """Return the vehicle's heading, radians from north; raises NotReady before the first."""
    attitude = vehicle.state.attitude
    if attitude is None:
        raise NotReady("attitude is unknown")
    return attitude.yaw % math.tau


def not_in_the_air() -> NotReady:
    """Return the error for a vehicle that is not flying."""
    return NotReady("not in the air", hint="send takeoff first")


def not_armed() -> NotReady:
    """Return the error for a vehicle on the surface whose motors are off."""
    return NotReady("it is not armed", hint="send arm first")


def home_unknown() -> NotReady:
    """Return the error for a vehicle that has not reported its home yet."""
    return NotReady("home is unknown", hint="wait for a position")
