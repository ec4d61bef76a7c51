"""MAVLink vehicles: drones, planes, rovers and boats on ArduPilot or PX4."""

from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig

__all__ = ["MavlinkAdapter", "MavlinkConfig"]
