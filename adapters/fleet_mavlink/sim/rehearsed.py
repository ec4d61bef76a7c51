"""Simulated vehicle of a rehearsal: the same as behind ``sim:`` links, in simulated time."""

from __future__ import annotations

import math

from fleet import Refused, Simulation, SimulationStart
from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_plane import ArduPlane
from fleet_mavlink.ardupilot_rover import ArduRover
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.px4 import Px4
from fleet_mavlink.sim.spec import QUICK_READY, VehicleName, VehicleSpec
from fleet_mavlink.sim.vehicle import FlavourName, SimVehicle
from fleet_mavlink.sim.wire import MavlinkWire

_PX4_MODES = frozenset(Px4.modes.values()) - frozenset(ArduCopter.modes.values())
_PLANE_MODES = (
    frozenset(ArduPlane.modes.values())
    - frozenset(ArduCopter.modes.values())
    - frozenset(ArduRover.modes.values())
    - _PX4_MODES
)
_ROVER_MODES = (
    frozenset(ArduRover.modes.values())
    - frozenset(ArduCopter.modes.values())
    - frozenset(ArduPlane.modes.values())
    - _PX4_MODES
)
_NAMES = {"ardupilot": "ArduPilot", "px4": "PX4"}


def simulated_vehicle(config: MavlinkConfig, start: SimulationStart) -> Simulation:
    """Return a vehicle at the position of the robot.

    For a real robot the name of its mode determines PX4 or ArduPilot, and a rover or a plane if the mode
    exists there only (HOLD, TAKEOFF); else it is a multirotor. Raises Refused while its motors run, and while
    its position is unknown.
    """
    if start.armed:
        raise Refused(
            f"{config.name}: its motors run, and a rehearsal begins with aircraft on the ground",
            hint="land it first",
        )
    if start.point is None:
        raise Refused(
            f"{config.name}: its position on Earth is unknown",
            hint="say site: {origin: [latitude, longitude, altitude]} in fleet.yaml",
        )
    spec = _spec(config, start)
    heading = 90.0 - math.degrees(start.heading or 0.0)
    vehicle = SimVehicle(
        spec.flavour,
        vehicle=spec.vehicle,
        system_id=spec.system_id,
        home=(start.point.latitude, start.point.longitude, start.point.altitude or 0.0, heading),
        ready_after=QUICK_READY,  # the robot itself has started already
        faults=spec.faults,
        seed=spec.seed,
        epoch=start.epoch,
    )
    if start.battery is not None:
        vehicle.set_fault("low_battery", start.battery)
    wire = MavlinkWire(vehicle, spec.accessories)
    changes = {
        "link": f"memory:{config.name}",
        "backup_links": (),
        "signing_key": None,
        "failsafes": "set",
        "watchers": (),
        "remote_id": None,
        "traffic": "off",
    }
    return Simulation(
        what=f"simulated {_NAMES[spec.flavour]} {spec.vehicle}",
        config=config.model_copy(update=changes),
        receive=lambda data, now: b"".join(wire.receive(data, now)),
        step=lambda now: b"".join(wire.step(now)),
    )


def _spec(config: MavlinkConfig, start: SimulationStart) -> VehicleSpec:
    """Return the vehicle to simulate: by its link, for a real vehicle one of its kind."""
    if config.simulated:
        return VehicleSpec.parse(config.link, system_id=config.system_id)
    flavour: FlavourName = "px4" if start.mode in _PX4_MODES else "ardupilot"
    vehicle: VehicleName = "rover" if start.mode in _ROVER_MODES else "multirotor"
    if start.mode in _PLANE_MODES:
        vehicle = "plane"
    return VehicleSpec(flavour, vehicle, system_id=config.system_id, seed=start.seed)
