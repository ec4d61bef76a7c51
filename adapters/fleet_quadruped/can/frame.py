"""A CAN frame, and what the drives ask of a bus."""

from __future__ import annotations

from typing import Protocol

import msgspec


class Frame(msgspec.Struct, frozen=True, gc=False):
    """One data frame: identifier (extended when it is beyond 7FFh) and up to eight bytes.

    Thousands are made in a second, so it is what is made quickest.
    """

    id: int
    data: bytes


class CanBus(Protocol):
    """An open CAN bus. Sending never blocks; a frame that cannot be sent is dropped and counted."""

    name: str

    def send(self, frame: Frame) -> None:
        """Send a frame, or drop and count it: a newer one comes in the next cycle."""

    def receive(self, wait: float) -> list[Frame]:
        """Return what has arrived, waiting up to ``wait`` seconds for the first; empty when nothing did.

        Raises LinkLost when the bus is gone.
        """

    def close(self) -> None:
        """Close; harmless when closed."""
