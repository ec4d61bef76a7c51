"""Reports the aircraft of this process to each other like ADS-B receivers (ADSB_VEHICLE).

Only flying aircraft are reported, and only to armed ones: on the ground it would be a false alarm. The
autopilot's reaction to traffic is set in its own parameters, which are not changed.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import AsyncIterator, Iterable, Iterator
from uuid import UUID

import msgspec

from fleet import GeoOrigin, LinkLost, Robot, world_from_geo
from fleet_mavlink.broadcast_messages import AdsbVehicle
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_EVERY = 1.0  # s, like ADS-B
_FARTHEST = 2000.0  # m; ArduPilot ignores farther aircraft (ADSB_LIST_RADIUS)
_MOST = 10  # aircraft, the nearest: a radio link is slow
_FRESH = 5.0  # s for which autopilots remember an aircraft
_ADDRESSES = range(0xF80000, 0xFFFFFF)  # ICAO addresses not allocated to any state
_CALLSIGN = 8  # characters
_UNMANNED = 14  # ADSB_EMITTER_TYPE
_BY_SATELLITES = 1  # ADSB_ALTITUDE_TYPE
_COORDINATES, _ALTITUDE, _HEADING, _VELOCITY, _NAMED, _SIMULATED, _CLIMB = 1, 2, 4, 8, 16, 64, 128
_SHOWN = _COORDINATES | _ALTITUDE | _NAMED


class Aircraft(msgspec.Struct, frozen=True):
    """One aircraft of the process, with the ICAO address and the callsign reported to others."""

    vehicle: Vehicle
    address: int
    callsign: str
    simulated: bool


class Traffic:
    """All aircraft of a process."""

    def __init__(self) -> None:
        self.aircraft: dict[int, Aircraft] = {}

    @contextlib.contextmanager
    def member(self, vehicle: Vehicle, name: str, twin: UUID, *, simulated: bool) -> Iterator[Aircraft]:
        """Add an aircraft; its unique address is derived from its twin."""
        first = twin.int % len(_ADDRESSES)
        order = (_ADDRESSES[(first + step) % len(_ADDRESSES)] for step in range(len(_ADDRESSES)))
        address = next(each for each in order if each not in self.aircraft)
        one = self.aircraft[address] = Aircraft(vehicle, address, callsign_of(name), simulated)
        try:
            yield one
        finally:
            del self.aircraft[address]


def callsign_of(name: str) -> str:
    """Return a robot's name as a callsign: capitals and digits."""
    return re.sub(r"[^A-Z0-9]", "", name.upper())[:_CALLSIGN]


def near(own: Aircraft, aircraft: Iterable[Aircraft], now: float) -> list[AdsbVehicle]:
    """Return the messages for an aircraft at monotonic ``now``: the nearest others that fly."""
    here = own.vehicle.state.position
    if here is None or not own.vehicle.state.armed:
        return []
    origin = GeoOrigin(here.latitude, here.longitude, here.altitude)
    found: list[tuple[float, AdsbVehicle]] = []
    for other in aircraft:
        state = other.vehicle.state
        if other is own or state.position is None or not state.in_air:
            continue
        away = world_from_geo(origin, state.position).norm()
        if away <= _FARTHEST and now - state.position_at <= _FRESH:
            found.append((away, adsb_vehicle(other, state, now)))
    found.sort(key=lambda each: each[0])
    return [message for _, message in found[:_MOST]]


def adsb_vehicle(other: Aircraft, state: VehicleState, now: float) -> AdsbVehicle:
    """Return the message about an aircraft; raises ValueError without a position."""
    position, velocity = state.position, state.velocity
    if position is None:
        raise ValueError("no position")
    flags, course, speed, climb = _SHOWN, 0, 0, 0
    if velocity is not None:
        flags |= _HEADING | _VELOCITY | _CLIMB
        course = round(math.degrees(math.atan2(velocity.y, velocity.x)) * 100) % 36_000
        speed = min(round(velocity.horizontal() * 100), 0xFFFF)
        climb = max(-0x7FFF, min(round(-velocity.z * 100), 0x7FFF))
    return AdsbVehicle(
        ICAO_address=other.address,
        lat=round(position.latitude * 1e7),
        lon=round(position.longitude * 1e7),
        altitude=round(position.altitude * 1000),
        heading=course,
        hor_velocity=speed,
        ver_velocity=climb,
        flags=flags | (_SIMULATED if other.simulated else 0),
        altitude_type=_BY_SATELLITES,
        callsign=other.callsign,
        emitter_type=_UNMANNED,
        tslc=int(max(0.0, now - state.position_at)),
    )


@contextlib.asynccontextmanager
async def _open_traffic() -> AsyncIterator[Traffic]:
    """Provide the traffic of this process."""
    yield Traffic()


@contextlib.asynccontextmanager
async def _joined(traffic: Traffic, config: MavlinkConfig, vehicle: Vehicle) -> AsyncIterator[Aircraft]:
    """Add an aircraft to the traffic."""
    with traffic.member(vehicle, config.name, config.twin, simulated=config.simulated) as one:
        yield one


async def report_traffic(config: MavlinkConfig, robot: Robot, vehicle: Vehicle) -> None:
    """Report a vehicle to the others until its attempt ends; report the others to it, if configured."""
    traffic = await robot.enter(robot.share("mavlink traffic", _open_traffic))
    own = await robot.enter(_joined(traffic, config, vehicle))

    def tell() -> None:
        if not vehicle.connected:
            return
        with contextlib.suppress(LinkLost):  # the session detects it
            for each in near(own, traffic.aircraft.values(), vehicle.now()):
                vehicle.send(each)

    if config.traffic == "send":
        robot.every(_EVERY, tell)
