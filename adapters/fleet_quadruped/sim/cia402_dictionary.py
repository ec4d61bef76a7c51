"""Object dictionary of a simulated CiA 402 drive, with the variants of other models."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from fleet import CanFrame
from fleet_quadruped.drives.cia402.setup import MAX_TORQUE, MODE_DISPLAY, OPTIONAL, mapping_objects
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.brakes import DISABLE_OPTION, FAULT_OPTION, QUICK_STOP_OPTION, STIFF
from fleet_quadruped.sim.sdo import DictionaryEntry, SdoServer

ERROR_BEHAVIOUR = (0x1029, 1)
_NO_LIMIT = 0xFFFF  # in 6072h


class DriveConfiguration(NamedTuple):
    """Written values: heartbeat timeout of the master and own heartbeat period (s, infinite for none).

    ``reach``: largest effective position error (rad) under the torque limit. ``cycle``: interpolation period,
    s.
    """

    timeout: float = math.inf
    beat: float = math.inf
    reach: float = math.inf
    cycle: float = 0.001


class Cia402Dictionary(SdoServer):
    """Dictionary of the drive of one joint, served over SDO."""

    def __init__(self, joint: Joint, drive: Drive, send: Callable[[CanFrame], None]) -> None:
        super().__init__(joint.id, _objects(joint, drive), send)
        self._rated_torque = joint.kind.rated_torque
        self.objects[MODE_DISPLAY] = self.objects[0x6060, 0]

    def configuration(self) -> DriveConfiguration:
        """Return the written values."""
        value = {place: entry.value for place, entry in self.objects.items()}
        limit = value.get(MAX_TORQUE, _NO_LIMIT)
        exponent = value[0x60C2, 2]
        return DriveConfiguration(
            (value[0x1016, 1] & 0xFFFF) / 1000 or math.inf,
            value[0x1017, 0] / 1000 or math.inf,
            math.inf if limit == _NO_LIMIT else limit / 1000 * self._rated_torque / STIFF,
            value[0x60C2, 1] * 10.0 ** (exponent - 256 if exponent > 127 else exponent),
        )

    def keep_mode(self) -> None:
        """Keep the present mode, whatever is requested."""
        self.objects[MODE_DISPLAY] = DictionaryEntry(1, 1)

    def pretend(self) -> None:
        """Identify as an I/O module."""
        self.objects[0x1000, 0].value = 0x0003_0191

    def be_plain(self) -> None:
        """Remove torque offset (60B2h) and torque (6077h)."""
        del self.objects[0x60B2, 0], self.objects[0x6077, 0]
        self.unmappable = frozenset(OPTIONAL)

    def be_simple(self) -> None:
        """Remove the error behaviour (1029h): the node leaves operational after a communication error."""
        del self.objects[ERROR_BEHAVIOUR]

    def refuse(self) -> None:
        """Refuse the first entry of the target PDO's mapping."""
        self.refusals[0x1600, 1] = 0x06040041


def _objects(joint: Joint, drive: Drive) -> dict[tuple[int, int], tuple[int, int]]:
    """Return the drive's objects: (index, subindex) to (size in bytes, value)."""
    objects = {
        (0x1000, 0): (4, 0x0002_0192),
        (0x1001, 0): (1, 0),
        (0x1018, 1): (4, 0x00F1EE70),
        (0x1018, 2): (4, 0x0402),
        (0x6502, 0): (4, 0x80),
        (0x1016, 1): (4, 0),
        (0x1017, 0): (2, 0),
        (0x6007, 0): (2, 0),
        QUICK_STOP_OPTION: (2, 2),
        DISABLE_OPTION: (2, 1),
        FAULT_OPTION: (2, 2),
        ERROR_BEHAVIOUR: (1, 0),
        (0x60C2, 1): (1, 1),
        (0x60C2, 2): (1, 0xFD),
        (0x6060, 0): (1, 0),
        MAX_TORQUE: (2, _NO_LIMIT),
        (0x60B2, 0): (2, 0),
        (0x6077, 0): (2, 0),
    }
    objects.update({(item.place, item.sub): (item.size, 0) for item in mapping_objects(drive, joint.id)})
    return objects
