"""Cyclic frames of a CiA 402 drive: PDOs, emergencies, heartbeats.

Little-endian throughout. RPDO1 = 6040h, 607Ah, 60B2h; TPDO1 = 6041h, 6064h, 6077h; TPDO2 = 6079h, 603Fh and
the manufacturer-specific object for the temperature, if the description has one. 60B2h and 6077h are left out
for a drive that lacks them.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from fleet_quadruped.robot.joint import Joint

NMT = 0x000
NMT_START = 0x01
SYNC = 0x080
OUR_SILENCE = 0x8130  # emergency error code: our heartbeat is missing
EMERGENCY = 0x080  # + node id
TPDO1 = 0x180
RPDO1 = 0x200
TPDO2 = 0x280
SDO_RESPONSE = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
MASTER = 0x7F  # our own node id
OPERATIONAL = 0x05
BOOT_UP = 0x00
STOPPED, PRE_OPERATIONAL = 0x04, 0x7F  # NMT states in which a node ignores PDOs

_CYCLIC = struct.Struct("<Hih")
_WITHOUT_TORQUE = struct.Struct("<Hi")
SHORT = _WITHOUT_TORQUE.size  # bytes of a PDO without a torque
_SLOW = struct.Struct("<IH")
_TEMPERATURE = struct.Struct("<h")
_EMERGENCY = struct.Struct("<HB")
MOST_COUNTS = (1 << 31) - 1
_I32 = (-MOST_COUNTS - 1, MOST_COUNTS)
_I16 = (-(1 << 15), (1 << 15) - 1)


class StatusPdo(NamedTuple):
    """TPDO1: status word, position in counts, torque in per mille of rated torque."""

    status: int
    counts: int
    per_mille: int


class SlowPdo(NamedTuple):
    """TPDO2: DC link voltage (V), error code 603Fh, temperature in the drive's own units if mapped."""

    voltage: float
    code: int
    temperature: int | None


class Emergency(NamedTuple):
    """An emergency message: error code 603Fh and error register 1001h."""

    code: int
    register: int

    @property
    def cleared(self) -> bool:
        """True if it reports that the error is gone."""
        return self.code == 0 and not self.register & 1

    @property
    def text(self) -> str:
        """Text for the code."""
        return f"{meaning(self.code)} (emergency {self.code:04X}h, register {self.register:02X}h)"


def pack_target(control: int, counts: int, per_mille: int | None) -> bytes:
    """Return RPDO1, without torque if it is None; numbers out of range are clamped, never wrapped.

    TPDO1 has the same layout, with the status word in place of the control word.
    """
    if per_mille is None:
        return _WITHOUT_TORQUE.pack(control & 0xFFFF, _clamp(counts, _I32))
    try:
        return _CYCLIC.pack(control, counts, per_mille)
    except struct.error:
        return _CYCLIC.pack(control & 0xFFFF, _clamp(counts, _I32), _clamp(per_mille, _I16))


def unpack_status_pdo(data: bytes) -> StatusPdo | None:
    """Decode TPDO1, torque 0 if not mapped; None if it is too short. RPDO1 has the same layout."""
    if len(data) == _WITHOUT_TORQUE.size:
        status, counts = _WITHOUT_TORQUE.unpack(data)
        return StatusPdo(status, counts, 0)
    return StatusPdo(*_CYCLIC.unpack_from(data)) if len(data) >= _CYCLIC.size else None


def pack_slow(slow: SlowPdo) -> bytes:
    """Return TPDO2 (drive side)."""
    temperature = b"" if slow.temperature is None else _TEMPERATURE.pack(_clamp(slow.temperature, _I16))
    return _SLOW.pack(round(slow.voltage * 1000), slow.code) + temperature


def unpack_slow(data: bytes) -> SlowPdo | None:
    """Decode TPDO2; None if it is too short."""
    if len(data) < _SLOW.size:
        return None
    millivolts, code = _SLOW.unpack_from(data)
    has_temperature = len(data) >= _SLOW.size + _TEMPERATURE.size
    return SlowPdo(
        millivolts / 1000, code, _TEMPERATURE.unpack_from(data, _SLOW.size)[0] if has_temperature else None
    )


def unpack_emergency(data: bytes) -> Emergency | None:
    """Decode an emergency; a short one is padded with zeros, an empty one ignored (None)."""
    if not data:
        return None
    return Emergency(*_EMERGENCY.unpack_from(data.ljust(_EMERGENCY.size, b"\x00")))


class CountUnits:
    """Conversion for one joint: rad and N m of the joint, counts and per mille of the motor."""

    __slots__ = ("_counts", "_per_mille", "_zero")

    def __init__(self, joint: Joint) -> None:
        self._zero = joint.motor(0.0) * joint.kind.counts_per_rad
        self._counts = joint.motor(1.0) * joint.kind.counts_per_rad - self._zero
        self._per_mille = joint.sign * 1000 / joint.kind.rated_torque

    def pack(self, word: int, angle: float, torque: float | None) -> bytes:
        """Return RPDO1 or TPDO1 for an angle and a torque of the joint; see ``pack_target``."""
        counts = round(self._zero + self._counts * angle)
        return pack_target(word, counts, None if torque is None else round(self._per_mille * torque))

    def unpack(self, data: bytes) -> tuple[int, float, float] | None:
        """Return word, angle and torque of the joint; see ``unpack_status_pdo``."""
        decoded = _CYCLIC.unpack(data) if len(data) == _CYCLIC.size else unpack_status_pdo(data)
        if decoded is None:
            return None
        word, counts, per_mille = decoded
        return word, (counts - self._zero) / self._counts, per_mille / self._per_mille

    def per_mille(self, torque: float) -> int:
        """Return a torque in per mille of rated torque."""
        return round(self._per_mille * torque)

    @property
    def factors(self) -> tuple[float, float, float]:
        """Counts at zero, counts per rad, per mille per N m."""
        return self._zero, self._counts, self._per_mille


class Rpdos:
    """Encoder of RPDO1 for several joints at once, because each cycle needs them all."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._units = [CountUnits(joint) for joint in joints]
        self._factors = [units.factors for units in self._units]
        self._layout = struct.Struct("<" + _CYCLIC.format.lstrip("<") * len(joints))

    def pack(self, words: Sequence[int], angles: Sequence[float], torques: Sequence[float]) -> list[bytes]:
        """Return each joint's RPDO1; its first ``SHORT`` bytes are one without torque."""
        numbers: list[int] = []
        for word, angle, torque, (zero, counts, per_mille) in zip(
            words, angles, torques, self._factors, strict=True
        ):
            numbers += word, round(zero + counts * angle), round(per_mille * torque)
        try:
            whole = self._layout.pack(*numbers)
        except struct.error:  # a number is out of range: clamp it
            per_joint = zip(self._units, words, angles, torques, strict=True)
            return [units.pack(word, angle, torque) for units, word, angle, torque in per_joint]
        return [whole[at : at + _CYCLIC.size] for at in range(0, len(whole), _CYCLIC.size)]


_EXACT: Mapping[int, str] = MappingProxyType(
    {
        OUR_SILENCE: "our heartbeat did not reach the drive",
        0x8611: "following error",
        0x7305: "encoder",
        0x3210: "over-voltage",
        0x3220: "under-voltage",
    }
)
_CLASSES: Mapping[int, str] = MappingProxyType(
    {
        0x1: "generic error",
        0x2: "over-current",
        0x3: "voltage",
        0x4: "temperature",
        0x5: "hardware of the drive",
        0x6: "software of the drive",
        0x7: "sensor or brake",
        0x8: "communication or following",
        0x9: "external error",
    }
)


def meaning(code: int) -> str:
    """Return the meaning of an error code (603Fh)."""
    if code == 0:
        return "no error code"
    return _EXACT.get(code) or _CLASSES.get(code >> 12) or "the maker's own error"


def _clamp(value: int, limits: tuple[int, int]) -> int:
    return max(limits[0], min(limits[1], value))
