"""Drones on MAVLink: ArduPilot and PX4."""

from fleet_mavlink.adapter import MavlinkAdapter, MavlinkConfig

__all__ = ["MavlinkAdapter", "MavlinkConfig"]
