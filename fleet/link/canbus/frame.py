"""A CAN frame, its packed form on links, and the interface of a bus."""

from __future__ import annotations

import struct
from typing import Protocol, Self

import msgspec

STANDARD_ID = 0x7FF
"""The highest identifier of a standard frame; a higher one makes an extended frame."""

HIGHEST_ID = 0x1FFFFFFF
FD_LENGTHS = frozenset({*range(9), 12, 16, 20, 24, 32, 48, 64})
_HEAD = struct.Struct("<IB")  # identifier; flags: 1 remote, 2 CAN FD


class CanFrame(msgspec.Struct, frozen=True, gc=False):
    """One frame: identifier (extended above STANDARD_ID) and up to eight bytes, 64 in CAN FD.

    ``fd``: a CAN FD frame, sent with the data bit rate; ``remote``: requests the frame of that identifier.
    Thousands are created each second, so it is a Struct that the garbage collector does not track.
    """

    id: int
    data: bytes
    fd: bool = False
    remote: bool = False

    @property
    def extended(self) -> bool:
        """True for an extended frame."""
        return self.id > STANDARD_ID

    def packed(self) -> bytes:
        """Return it as the bytes that a ``can:`` link carries.

        Raises ValueError for an identifier or a length that CAN does not have.
        """
        size = len(self.data)
        if not 0 <= self.id <= HIGHEST_ID:
            raise ValueError(f"{self.id:X}h is not a CAN identifier; the highest is {HIGHEST_ID:X}h")
        if self.fd and self.remote:
            raise ValueError("CAN FD has no remote frames")
        if (size > 8 and not self.fd) or (self.fd and size not in FD_LENGTHS) or (self.remote and size):
            kind = "remote" if self.remote else "CAN FD" if self.fd else "classic"
            raise ValueError(f"a {kind} frame has no {size} bytes of data")
        return _HEAD.pack(self.id, self.fd << 1 | self.remote) + self.data

    @classmethod
    def unpack(cls, data: bytes) -> Self | None:
        """Return the frame that a ``can:`` link has received; None for invalid bytes."""
        if len(data) < _HEAD.size:
            return None
        number, flags = _HEAD.unpack_from(data)
        return cls(number, data[_HEAD.size :], bool(flags & 2), bool(flags & 1))


def is_foreign(identifier: int, *, extended: bool) -> bool:
    """Return whether to ignore a received frame: extended, with an identifier in the standard range.

    As a ``CanFrame`` it would look like the standard frame of that identifier.
    """
    return extended and identifier <= STANDARD_ID


class CanBus(Protocol):
    """An open CAN bus. Sending never blocks; a frame that cannot be sent is dropped and counted."""

    name: str

    def send(self, frame: CanFrame) -> None:
        """Send a frame, or drop and count it: a newer one follows in the next cycle."""

    def receive(self, wait: float) -> list[CanFrame]:
        """Return the received frames, waiting up to ``wait`` seconds for the first; empty if there is none.

        Raises LinkLost when the bus is gone.
        """

    def close(self) -> None:
        """Close; harmless when closed."""
