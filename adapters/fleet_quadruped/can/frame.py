"""A CAN frame, and what the drives ask of a bus."""

from __future__ import annotations

from typing import Protocol

import msgspec

STANDARD_ID = 0x7FF
"""The largest identifier of a standard frame; one beyond it makes an extended frame."""


class CanFrame(msgspec.Struct, frozen=True, gc=False):
    """One frame: identifier (extended when it is beyond STANDARD_ID) and up to eight bytes, 64 in CAN FD.

    ``fd``: a frame of CAN FD, sent with the data bit rate; ``remote``: asks for the frame of that identifier.
    Thousands are made in a second, so it is what is made quickest.
    """

    id: int
    data: bytes
    fd: bool = False
    remote: bool = False

    @property
    def extended(self) -> bool:
        """True when it is an extended frame."""
        return self.id > STANDARD_ID


def is_foreign(identifier: int, *, extended: bool) -> bool:
    """Tell whether a frame that was read is nobody's here: extended, with the number of a standard one.

    As a ``CanFrame`` it could not be told from that one.
    """
    return extended and identifier <= STANDARD_ID


class CanBus(Protocol):
    """An open CAN bus. Sending never blocks; a frame that cannot be sent is dropped and counted."""

    name: str

    def send(self, frame: CanFrame) -> None:
        """Send a frame, or drop and count it: a newer one comes in the next cycle."""

    def receive(self, wait: float) -> list[CanFrame]:
        """Return what has arrived, waiting up to ``wait`` seconds for the first; empty when nothing did.

        Raises LinkLost when the bus is gone.
        """

    def close(self) -> None:
        """Close; harmless when closed."""
