"""Integrity of frames in proprietary protocols: a rolling counter, a checksum over the bytes."""

from __future__ import annotations

from functools import reduce
from operator import xor
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

_CRC_POLYNOMIAL, _CRC_START, _CRC_END = 0x1D, 0xFF, 0xFF  # CRC-8 of SAE J1850


class Counter(BaseModel):
    """A counter that grows by one with each frame of an identifier, and wraps."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: int = Field(ge=0, le=7, description="Position of the byte.")
    bits: Literal[4, 8] = Field(8, description="4: one half of the byte.")
    shift: Literal[0, 4] = Field(0, description="4: the upper half of the byte.")

    @property
    def mask(self) -> int:
        """Mask of the counter's bits in its byte."""
        return ((1 << self.bits) - 1) << self.shift & 0xFF


class Checksum(BaseModel):
    """A byte computed from all other bytes of the frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: int = Field(ge=0, le=7, description="Position of the byte.")
    kind: Literal["sum", "xor", "crc8"] = Field("sum", description="crc8 is the CRC of SAE J1850.")
    header: bool = Field(
        False, description="Also covers the identifier's two bytes and the length, as in AgileX's version 1."
    )

    def of(self, identifier: int, data: bytes) -> int:
        """Return the checksum of a frame, independent of the byte now in its place."""
        head = bytes([identifier >> 8 & 0xFF, identifier & 0xFF, len(data)]) if self.header else b""
        covered = head + data[: self.at] + data[self.at + 1 :]
        if self.kind == "sum":
            return sum(covered) & 0xFF
        return reduce(xor, covered, 0) if self.kind == "xor" else _crc8(covered)


class ProtectedFrame(BaseModel):
    """A frame with an optional counter and an optional checksum."""

    counter: Counter | None = Field(None, description="Counter that increases with each frame.")
    checksum: Checksum | None = Field(None, description="Checksum over the other bytes.")

    @property
    def integrity_bytes(self) -> dict[int, str]:
        """The byte positions of counter and checksum, with their names."""
        both = {"counter": self.counter, "checksum": self.checksum}
        return {part.at: name for name, part in both.items() if part is not None}


class FrameIntegrity:
    """State of counter and checksum of one identifier, for one direction."""

    def __init__(self, identifier: int, protected: ProtectedFrame) -> None:
        self._identifier = identifier
        self._counter, self._checksum = protected.counter, protected.checksum
        self._count: int | None = None

    def put(self, data: bytes) -> bytes:
        """Return the data of the next frame, with counter and checksum filled in."""
        protected = bytearray(data)
        counter, checksum = self._counter, self._checksum
        if counter is not None:
            self._count = 0 if self._count is None else self._count + 1
            value = self._count << counter.shift & counter.mask
            protected[counter.at] = protected[counter.at] & ~counter.mask & 0xFF | value
        if checksum is not None:
            protected[checksum.at] = checksum.of(self._identifier, bytes(protected))
        return bytes(protected)

    def accepts(self, data: bytes) -> bool:
        """Return True for a valid frame: correct checksum, and a counter that has changed."""
        counter, checksum = self._counter, self._checksum
        if checksum is not None and data[checksum.at] != checksum.of(self._identifier, data):
            return False
        if counter is not None:
            count = data[counter.at] & counter.mask
            if count == self._count:
                return False
            self._count = count
        return True

    def bare(self, data: bytes) -> bytes:
        """Return the data with counter and checksum cleared."""
        bare = bytearray(data)
        if self._counter is not None:
            bare[self._counter.at] &= ~self._counter.mask & 0xFF
        if self._checksum is not None:
            bare[self._checksum.at] = 0
        return bytes(bare)


def _crc8(data: bytes) -> int:
    crc = _CRC_START
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ _CRC_POLYNOMIAL if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ _CRC_END
