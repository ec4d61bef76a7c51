"""The waiting messages in memory, by traffic class, and their bound."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator

from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass

DURABLE = tuple(traffic for traffic in TrafficClass if traffic.durable)
"""The durable classes, the most important first; their values count from 0."""


class MemoryBuffer:
    """The messages in memory, the oldest first; bounded by ``messages`` and ``size`` (bytes)."""

    def __init__(self, messages: int, size: int) -> None:
        self.count = 0
        self._bytes = [0 for _ in DURABLE]
        self._all_bytes = 0
        self._most = messages
        self._most_bytes = size
        self._held: list[OrderedDict[int, Outgoing]] = [OrderedDict() for _ in DURABLE]

    @property
    def full(self) -> bool:
        """True when there is no room for another message of usual size."""
        return self.count >= self._most or self._all_bytes >= self._most_bytes

    @property
    def room(self) -> int:
        """How many more messages fit by their number alone."""
        return max(0, self._most - self.count)

    def fits(self, message: Outgoing, share: int = 1) -> bool:
        """Return whether there is room for a message within ``share`` times the bound."""
        size = self._all_bytes + message.size
        return self.count < share * self._most and size <= share * self._most_bytes

    def can_fit(self, message: Outgoing, share: int) -> bool:
        """Return whether it would fit if all messages of the same or lower importance were dropped."""
        count = sum(len(held) for held in self._held[: message.traffic])
        size = sum(self._bytes[: message.traffic]) + message.size
        return count < share * self._most and size <= share * self._most_bytes

    def add(self, message: Outgoing) -> None:
        """Add a message."""
        self._held[message.traffic][message.seq] = message
        self.count += 1
        self._bytes[message.traffic] += message.size
        self._all_bytes += message.size

    def add_again(self, message: Outgoing) -> None:
        """Add a message that is older than all others of its class."""
        self.add(message)
        self._held[message.traffic].move_to_end(message.seq, last=False)

    def remove(self, message: Outgoing) -> None:
        """Remove a message, if present."""
        if self._held[message.traffic].pop(message.seq, None) is not None:
            self.count -= 1
            self._bytes[message.traffic] -= message.size
            self._all_bytes -= message.size

    def droppable(self, message: Outgoing, share: int) -> Iterator[Outgoing]:
        """Yield the messages to drop for a message that can fit: the oldest of the least important class.

        The caller removes each one before it asks for the next.
        """
        for held in reversed(self._held):
            while held and not self.fits(message, share):
                yield next(iter(held.values()))

    def all(self) -> list[Outgoing]:
        """Return all messages."""
        return [message for held in self._held for message in held.values()]

    def late(self, now: float) -> Iterator[Outgoing]:
        """Yield the expired messages; the caller removes each one before it asks for the next."""
        for held in self._held:
            while held:
                first = next(iter(held.values()))
                if first.deadline is None or first.deadline > now:
                    break
                yield first
