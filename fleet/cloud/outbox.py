"""What waits to be sent: durable messages in the spool, and light ones (QoS 0), which never wait offline.

The spool sends replies first, then status, then events; light ones go behind them, in every write. A full
light lane refuses what is new.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable

from fleet.clock import Clock
from fleet.cloud.publish import Address, publish_light, renewed
from fleet.cloud.values import CloudStats, Queued
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool

Light = tuple[Address, bytes, float]
"""A message of QoS 0: where it goes, its packet, and since when (monotonic s) it waits.

Most of what an edge sends: nothing larger is made for each.
"""


class Outbox:
    """The queue between any thread that publishes and the loop that writes.

    ``messages`` and ``size`` (bytes) bound the light lane.
    """

    def __init__(self, spool: Spool, messages: int, size: int, stats: CloudStats, clock: Clock) -> None:
        self.spool = spool
        self._clock = clock
        self._most_messages = messages
        self._most_bytes = size
        self._lock = threading.Lock()
        self._light: deque[Light] = deque()
        stats.outbox = self._queued
        self._bytes = 0
        self._refused = 0
        self._online = False

    def __len__(self) -> int:
        return len(self._light) + self.spool.waiting

    def light(self, where: Address) -> Callable[[bytes], bool]:
        """Return what adds a message of QoS 0, by its payload, and tells whether it was taken.

        What is durable is put into the spool.
        """
        lock, waiting, now = self._lock, self._light, self._clock.monotonic

        def put(payload: bytes) -> bool:
            packet = publish_light(where, payload)
            size = len(packet) + OVERHEAD
            with lock:
                fits = len(waiting) < self._most_messages and self._bytes + size <= self._most_bytes
                taken = self._online and fits
                if taken:
                    waiting.append((where, packet, now()))
                    self._bytes += size
                else:
                    self._refused += 1
            return taken

        return put

    def take_light(self, now: float, size: int) -> list[tuple[Address, bytes]]:
        """Remove and return what of QoS 0 may be written next, about ``size`` bytes; drop what is late."""
        batch: list[tuple[Address, bytes]] = []
        with self._lock:
            while self._light and size > 0:
                where, packet, since = self._light.popleft()
                self._bytes -= len(packet) + OVERHEAD
                size -= len(packet)
                timely = renewed(where, packet, now - since)
                if timely is None:
                    self._refused += 1
                else:
                    batch.append((where, timely))
        return batch

    @property
    def waits(self) -> bool:
        """True while messages of QoS 0 wait."""
        return bool(self._light)

    def go_online(self) -> None:
        """From now on QoS 0 is taken."""
        self._online = True
        self.spool.go_online()

    def go_offline(self, unanswered: Iterable[Outgoing]) -> None:
        """Take back what was not acknowledged, oldest first; drop QoS 0 and take no more of it."""
        self.spool.put_back(unanswered)
        self.spool.go_offline()
        self._drop_light()

    def tick(self) -> None:
        """Look after time: once a second or so."""
        self.spool.tick()

    def close(self) -> None:
        """Take nothing more; what is durable stays on disk."""
        self._drop_light()
        self.spool.close()

    @property
    def idle(self) -> bool:
        """True when nothing could be sent now."""
        return not self._light and self.spool.idle

    def _drop_light(self) -> None:
        """Drop all of QoS 0, and take no more of it."""
        with self._lock:
            self._online = False
            self._refused += len(self._light)
            self._light.clear()
            self._bytes = 0

    def _queued(self) -> Queued:
        """Return the figures."""
        return Queued(len(self), self._bytes, self._refused + self.spool.lost)
