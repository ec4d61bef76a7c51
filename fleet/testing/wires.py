"""Faulty wires: damage to bytes as on real lines, reproducible with the same seed.

A wire takes the pieces that were sent and returns the pieces that arrive. Use it between two pure functions
(``for piece in wire.carry(data): framer.feed(piece)``), before a receiver (``over``), or around a link
(``WornLink``).
"""

from __future__ import annotations

import random
from typing import Protocol

from fleet.link.base import Address, Link, Receiver


class Wire(Protocol):
    """A transmission medium."""

    def carry(self, data: bytes) -> list[bytes]:
        """Take one piece; return the pieces that arrive now."""

    def rest(self) -> list[bytes]:
        """Return the pieces that are still in transit."""


class _Undelayed:
    """Base of wires that delay nothing."""

    def rest(self) -> list[bytes]:
        """Return nothing."""
        return []


class Datagrams(_Undelayed):
    """A good wire: every piece arrives whole."""

    def carry(self, data: bytes) -> list[bytes]:
        """Return the piece."""
        return [data]


class OneByteAtATime(_Undelayed):
    """Delivers every byte separately."""

    def carry(self, data: bytes) -> list[bytes]:
        """Return the single bytes."""
        return [data[index : index + 1] for index in range(len(data))]


class Lossy(_Undelayed):
    """Loses each piece with the probability ``rate``."""

    def __init__(self, seed: int = 0, rate: float = 0.2) -> None:
        self._random = random.Random(seed)  # noqa: S311 - repeatable on purpose
        self._rate = rate

    def carry(self, data: bytes) -> list[bytes]:
        """Return the piece, or nothing."""
        return [] if self._random.random() < self._rate else [data]


class Corrupt(_Undelayed):
    """Flips one bit of a piece with the probability ``rate``."""

    def __init__(self, seed: int = 0, rate: float = 0.2) -> None:
        self._random = random.Random(seed)  # noqa: S311 - repeatable on purpose
        self._rate = rate

    def carry(self, data: bytes) -> list[bytes]:
        """Return the piece, perhaps with one wrong bit."""
        if not data or self._random.random() >= self._rate:
            return [data]
        changed = bytearray(data)
        changed[self._random.randrange(len(changed))] ^= 1 << self._random.randrange(8)
        return [bytes(changed)]


class Delayed:
    """Delivers a piece when ``pieces`` later ones have been sent."""

    def __init__(self, pieces: int = 3) -> None:
        self._pieces = pieces
        self._waiting: list[bytes] = []

    def carry(self, data: bytes) -> list[bytes]:
        """Return the piece that is due."""
        self._waiting.append(data)
        return [self._waiting.pop(0)] if len(self._waiting) > self._pieces else []

    def rest(self) -> list[bytes]:
        """Return the waiting pieces, oldest first."""
        waiting, self._waiting = self._waiting, []
        return waiting


class Reordered:
    """Lets pieces overtake each other, among ``window`` at a time, as datagrams do."""

    def __init__(self, seed: int = 0, window: int = 4) -> None:
        self._random = random.Random(seed)  # noqa: S311 - repeatable on purpose
        self._window = window
        self._waiting: list[bytes] = []

    def carry(self, data: bytes) -> list[bytes]:
        """Return one of the pieces in transit as soon as there are ``window`` of them."""
        self._waiting.append(data)
        if len(self._waiting) < self._window:
            return []
        return [self._waiting.pop(self._random.randrange(len(self._waiting)))]

    def rest(self) -> list[bytes]:
        """Return the waiting pieces, in random order."""
        waiting, self._waiting = self._waiting, []
        self._random.shuffle(waiting)
        return waiting


def over(wire: Wire, receiver: Receiver) -> Receiver:
    """Return a receiver behind a wire."""

    def receive(data: bytes, address: Address) -> None:
        for piece in wire.carry(data):
            receiver(piece, address)

    return receive


class WornLink:
    """A link that sends through a wire."""

    def __init__(self, link: Link, wire: Wire) -> None:
        self.url = link.url
        self._link = link
        self._wire = wire

    def send(self, data: bytes, address: Address = None) -> bool:
        """Write the pieces that the wire delivers; raises LinkLost if the link is gone."""
        written = [self._link.send(piece, address) for piece in self._wire.carry(data)]
        return all(written)

    async def lost(self) -> None:
        """Wait until the link fails, then raise LinkLost with the reason."""
        await self._link.lost()

    async def close(self) -> None:
        """Close the link; pieces in transit on the wire are lost."""
        await self._link.close()
