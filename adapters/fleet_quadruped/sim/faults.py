"""Faults of a simulated robot by name; a joint is given by its number in ``JOINTS``, 1 to 12."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet.sim.faults import WIRE_FAULTS
from fleet_quadruped.sim.cia402 import SimDrive
from fleet_quadruped.sim.drive import AnyDrive
from fleet_quadruped.sim.sensors import SENSOR_FAULTS

DOG_FAULTS: Mapping[str, str] = MappingProxyType(
    {
        "mute": "joint 1 to 12 whose drive is silent",
        "reboot": "joint 1 to 12 whose drive restarts",
        "overcurrent": "joint 1 to 12 whose drive fails",
        "hot": "joint 1 to 12 whose drive is too hot",
        "warm": "joint 1 to 12 whose drive warms by 10 degrees a second",
        "short": "joint 1 to 12 whose drive fails and sends frames of two bytes",
        "deaf": "joint 1 to 12 whose drive (CiA 402) ignores its targets",
        "stays": "joint 1 to 12 whose drive (CiA 402) does not go on from a quick stop",
        "mode": "joint 1 to 12 whose drive (CiA 402) does not take its mode",
        "twin": "joint 1 to 12 at whose id there is a second drive",
        "jump": "joint 1 to 12 whose encoder jumps by 0.5 rad",
        "stuck": "joint 1 to 12 whose encoder is frozen",
        "weak": "joint 1 to 12 whose motor produces no torque",
        "lazy": "joint 1 to 12 whose drive ignores the first commands to enable it",
        "stranger": "joint 1 to 12 at whose id another device is",
        "abort": "joint 1 to 12 whose drive refuses its PDO mapping",
        "volts": "voltage of the supply",
        **SENSOR_FAULTS,
    }
)
WALKER_FAULTS: Mapping[str, str] = MappingProxyType(
    {
        **WIRE_FAULTS,
        "mute": "any number: it is silent",
        "battery": "battery percentage",
        "error": "error number",
        "tip": "tilt, rad",
        "idle": "any number: it ignores velocities and stands still",
        "runs": "any number: it ignores velocities and walks at 0.5 m/s",
    }
)
"""Faults of a self-walking machine."""

ALL_FAULTS: Mapping[str, str] = MappingProxyType({**WIRE_FAULTS, **DOG_FAULTS})

ON_DRIVE: Mapping[str, Callable[[AnyDrive], None]] = MappingProxyType(
    {
        "mute": lambda drive: drive.mute(),
        "reboot": lambda drive: drive.boot(),
        "overcurrent": lambda drive: drive.fail("overcurrent"),
        "hot": lambda drive: drive.fail("hot"),
        "warm": lambda drive: drive.warm(),
        "short": lambda drive: drive.cut_short(),
        "jump": lambda drive: drive.encoder.shift(0.5),
        "stuck": lambda drive: drive.encoder.stick(),
        "lazy": lambda drive: drive.doze(),
        "stranger": lambda drive: drive.pretend(),
        "abort": lambda drive: drive.refuse(),
    }
)
"""Effect of a fault on one drive of any protocol."""

ON_CIA402: Mapping[str, Callable[[SimDrive], None]] = MappingProxyType(
    {
        "deaf": lambda drive: drive.ignore(),
        "stays": lambda drive: drive.power.stay(),
        "mode": lambda drive: drive.sdo.keep_mode(),
    }
)
"""Effect of a fault on one CiA 402 drive."""
