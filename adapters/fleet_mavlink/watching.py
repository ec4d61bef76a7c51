"""Shows a robot's vehicle to the ground stations in fleet.yaml."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from functools import partial

from fleet import Robot
from fleet_mavlink.codec import Frame
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.message_targets import number_of
from fleet_mavlink.session import VehicleSession
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.watched_vehicle import WatchedVehicle
from fleet_mavlink.watcher import Watcher, open_watcher
from fleet_mavlink.watcher_config import WatcherConfig


async def show(config: MavlinkConfig, robot: Robot, hub: LinkHub, session: VehicleSession) -> None:
    """Show the vehicle until the robot's attempt ends; never waits for a station."""
    shown: list[WatchedVehicle] = []
    for each in config.watchers:
        make = partial(open_watcher, each.link, robot.clock)
        watcher = await robot.enter(robot.share(f"mavlink watcher {each.link}", make))
        vehicle = await robot.enter(_shown(each, watcher, robot, hub, session))
        if vehicle is not None:
            shown.append(vehicle)
    if shown:
        await robot.enter(_tapped(hub, session.vehicle, shown))


@contextlib.asynccontextmanager
async def _shown(
    config: WatcherConfig, watcher: Watcher, robot: Robot, hub: LinkHub, session: VehicleSession
) -> AsyncIterator[WatchedVehicle | None]:
    """Show the vehicle at one link; None if a vehicle with its id is shown there already."""
    vehicle = WatchedVehicle(
        config,
        watcher,
        hub,
        session.vehicle,
        authority=session.authority,
        stopped=lambda: robot.emergency_stop,
        halt=partial(session.halts.halt, takes_over=True),
        log=robot.log,
    )
    with watcher.showing(session.vehicle.system, vehicle) as is_shown:
        if not is_shown:
            system = session.vehicle.system
            robot.log.error("%s: another robot shows a vehicle with system_id %d there", config.link, system)
        yield vehicle if is_shown else None


@contextlib.asynccontextmanager
async def _tapped(hub: LinkHub, vehicle: Vehicle, shown: list[WatchedVehicle]) -> AsyncIterator[None]:
    """Pass the frames of the vehicle to all views of it."""
    shown_at = vehicle.shown_at = {}

    def give(frame: Frame) -> None:
        shown_at[number_of(frame.raw)] = vehicle.now()
        for each in shown:
            each.show(frame)

    with hub.tap(vehicle.system, give):
        yield
