"""Load of a CAN bus, computed from its frames: worst-case bit stuffing and interframe spacing included."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from fleet import STANDARD_ID
from fleet_quadruped.drives import drive_kind
from fleet_quadruped.robot.parts import CanBusConfig, DogBattery, Drive, Sensor

HIGHEST = 0.6  # share of a bus; beyond it, frames are late
SLOW_EVERY = 10  # control cycles per frame with velocity and voltage (TPDO2)
_BATTERY_HZ = 1.0


def frame_bits(length: int, *, extended: bool = False) -> int:
    """Return the largest number of bits of a data frame with ``length`` bytes on the wire."""
    header = 54 if extended else 34
    stuffed = header + 8 * length
    return stuffed + (stuffed - 1) // 4 + 13


def fd_frame_seconds(length: int, bus: CanBusConfig) -> float:
    """Return the longest time (s) of an extended CAN FD frame on a bus.

    ISO 11898-1: identifier and end of frame (48 bits) are sent at the nominal bit rate; length, data and a
    checksum of 17 bits (21 beyond 16 bytes) at the data bit rate, each with its fixed stuff bits.
    """
    check = (17 if length <= 16 else 21) + 4
    data = 5 + 8 * length + check
    stuffed = data + data // 4
    return (48 + 48 // 4) / bus.bitrate + stuffed / (bus.data_bitrate or bus.bitrate)


def bus_loads(
    drive: Drive, joints: Counter[str], sensors: list[Sensor], buses: Mapping[str, CanBusConfig]
) -> dict[str, float]:
    """Return the load of each bus as a share; ``joints``: number of drives on each bus."""
    load = drive_kind(drive.protocol).load
    loads = {name: load(drive, joints[name], bus) if joints[name] else 0.0 for name, bus in buses.items()}
    for sensor in sensors:
        rate = _BATTERY_HZ if isinstance(sensor, DogBattery) else drive.cycle_hz
        bits = sum(frame_bits(frame.length, extended=frame.id > STANDARD_ID) for frame in sensor.frames)
        loads[sensor.bus] += rate * bits / buses[sensor.bus].bitrate
    return loads
