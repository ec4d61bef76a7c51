"""Objects written into a CiA 402 drive before it may move, and verified by reading back."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from fleet_quadruped.drives.cia402.frames import MASTER, RPDO1, TPDO1, TPDO2
from fleet_quadruped.robot.busload import SLOW_EVERY
from fleet_quadruped.robot.parts import Drive

DEVICE_TYPE = (0x1000, 0)
PROFILE_402 = 402
MODES = (0x6502, 0)
MAX_TORQUE = (0x6072, 0)
TORQUE_OFFSET, TORQUE = 0x60B2_0010, 0x6077_0010
ERROR_BEHAVIOUR = 0x1029_0108
OPTIONAL = (TORQUE_OFFSET, TORQUE, ERROR_BEHAVIOUR)
"""Optional objects, as PDO mapping entries; the first two are the last of their PDOs."""
MODE_DISPLAY = (0x6061, 0)
CYCLIC_POSITION = 8
_DISABLED = 1 << 31
_BEHAVIOUR_QUICK_STOP = 3
_STAY_STOPPED = 6  # brake, then hold in quick stop: no torque-off while the robot stands
_STAY_OPERATIONAL = 1


class Object(NamedTuple):
    """One value of the object dictionary; ``size`` in bytes."""

    place: int
    sub: int
    size: int
    value: int
    what: str

    @property
    def name(self) -> str:
        """Index and subindex in the usual notation."""
        return f"{self.place:04X}h:{self.sub}"


def heartbeat_objects(drive: Drive) -> list[Object]:
    """Return the objects that stop the drive without our heartbeat, and make it send its own."""
    timeout = round(drive.timeout * 1000)
    return [
        Object(0x1016, 1, 4, MASTER << 16 | timeout, "time until our silence stops the drive"),
        Object(0x1017, 0, 2, round(drive.heartbeat * 1000), "period of its heartbeat"),
        Object(0x6007, 0, 2, _BEHAVIOUR_QUICK_STOP, "quick stop when our heartbeat is missing"),
        Object(0x605A, 0, 2, _STAY_STOPPED, "brake and hold"),
    ]


def error_objects(missing: Collection[int]) -> list[Object]:
    """Return the objects that keep a drive operational after our silence: by default it stops (CiA 301)."""
    if ERROR_BEHAVIOUR in missing:
        return []
    return [Object(0x1029, 1, 1, _STAY_OPERATIONAL, "stay operational when our heartbeat is missing")]


def mode_objects(cycle_hz: int) -> list[Object]:
    """Return mode and interpolation period."""
    period, exponent = _period(cycle_hz)
    return [
        Object(0x60C2, 1, 1, period, "interpolation period"),
        Object(0x60C2, 2, 1, exponent & 0xFF, "interpolation period, power of ten"),
        Object(0x6060, 0, 1, CYCLIC_POSITION, "cyclic synchronous position"),
    ]


def _period(cycle_hz: int) -> tuple[int, int]:
    """Return the cycle time as (number, power of ten of a second), the number in a byte.

    Where no number is exact, it is the nearest one of the finest unit that fits.
    """
    found = (1, -3)
    for exponent in (-3, -4, -5, -6):
        number = 10**-exponent / cycle_hz
        if round(number) > 255:
            break
        found = (round(number), exponent)
        if abs(number - round(number)) < 1e-9:
            break
    return found


def mapping_objects(drive: Drive, node: int, missing: Collection[int] = ()) -> list[Object]:
    """Return the PDO mappings; ``missing``: optional entries that this drive lacks."""
    receive = _without(missing, 0x60400010, 0x607A0020, TORQUE_OFFSET)
    mapped = _without(missing, 0x60410010, 0x60640020, TORQUE)
    temperature = [] if drive.temperature is None else [drive.temperature.entry]
    return [
        *pdo_objects(0x1400, 0x1600, RPDO1 + node, 1, receive),
        *pdo_objects(0x1800, 0x1A00, TPDO1 + node, 1, mapped),
        *pdo_objects(0x1801, 0x1A01, TPDO2 + node, SLOW_EVERY, (0x60790020, 0x603F0010, *temperature)),
    ]


def _without(missing: Collection[int], *entries: int) -> tuple[int, ...]:
    return tuple(entry for entry in entries if entry not in missing)


def pdo_objects(
    communication: int, mapping: int, cob: int, kind: int, entries: Sequence[int]
) -> list[Object]:
    """Return the objects of one PDO in the order required by CiA 301: disable, clear, map, count, enable."""
    mapped = [Object(mapping, sub, 4, entry, "mapping") for sub, entry in enumerate(entries, start=1)]
    return [
        Object(communication, 1, 4, _DISABLED | cob, "PDO off"),
        Object(communication, 2, 1, kind, "transmission type"),
        Object(mapping, 0, 1, 0, "no mapping"),
        *mapped,
        Object(mapping, 0, 1, len(entries), "number of mapped objects"),
        Object(communication, 1, 4, cob, "PDO on"),
    ]


def all_objects(drive: Drive, node: int, missing: Collection[int] = ()) -> list[Object]:
    """Return all objects to write, in order."""
    return [
        *heartbeat_objects(drive),
        *error_objects(missing),
        *mode_objects(drive.cycle_hz),
        *mapping_objects(drive, node, missing),
    ]


def final_values(objects: list[Object]) -> list[Object]:
    """Return the objects to verify: the last value of each."""
    return list({(item.place, item.sub): item for item in objects}.values())
