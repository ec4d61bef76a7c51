"""How full a classic CAN bus is, from its frames: worst-case bit stuffing, frame spacing included."""

from __future__ import annotations

from collections import Counter

from fleet_quadruped.can.frame import STANDARD_ID
from fleet_quadruped.robot.parts import Battery, Drive, Sensor

HIGHEST = 0.6  # share of a bus beyond which frames come late
SLOW_EVERY = 10  # cycles between two frames with velocity and voltage (TPDO2)
_BATTERY_HZ = 1.0


def frame_bits(length: int, *, extended: bool = False) -> int:
    """Return the most bits that a data frame of ``length`` bytes takes on the wire."""
    header = 54 if extended else 34
    stuffed = header + 8 * length
    return stuffed + (stuffed - 1) // 4 + 13


def bus_loads(
    drive: Drive, joints: Counter[str], sensors: list[Sensor], bitrates: dict[str, int]
) -> dict[str, float]:
    """Return each bus's load as a share; ``joints`` counts the drives on each bus."""
    from fleet_quadruped.drives import PROTOCOLS  # noqa: PLC0415 - they know the description

    bits = PROTOCOLS[drive.protocol].bits
    per_second = {bus: bits(drive, joints[bus]) if joints[bus] else 0.0 for bus in bitrates}
    for sensor in sensors:
        rate = _BATTERY_HZ if isinstance(sensor, Battery) else drive.cycle_hz
        for frame in sensor.frames:
            per_second[sensor.bus] += rate * frame_bits(frame.length, extended=frame.id > STANDARD_ID)
    return {bus: bits / bitrates[bus] for bus, bits in per_second.items()}
