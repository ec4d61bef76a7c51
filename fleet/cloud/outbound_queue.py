"""What waits to be sent: durable messages in the spool, and light ones (QoS 0), which never wait offline.

The spool sends replies first, then status, then events; light ones go behind them, in every write. A full
queue of QoS 0 refuses new messages.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable

from fleet.clock import Clock
from fleet.cloud.publish import PublishRoute, QueuedQos0
from fleet.cloud.values import CloudStats, QueueStats
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool


class OutboundQueue:
    """The queue between any thread that publishes and the loop that writes.

    ``messages`` and ``size`` (bytes) bound the queue of QoS 0.
    """

    def __init__(self, spool: Spool, messages: int, size: int, stats: CloudStats, clock: Clock) -> None:
        self.spool = spool
        self._clock = clock
        self._most_messages = messages
        self._most_bytes = size
        self._lock = threading.Lock()
        self._light: deque[QueuedQos0] = deque()
        stats.outbox = self._queued
        self._bytes = 0
        self._refused = 0
        self._online = False

    def __len__(self) -> int:
        return len(self._light) + self.spool.waiting

    def put_light(self, where: PublishRoute, payload: bytes) -> bool:
        """Add a message of QoS 0; tell whether it was taken. What is durable is put into the spool."""
        message = QueuedQos0(where, payload, self._clock.monotonic())
        with self._lock:
            size = self._bytes + _size(message)
            if not self._online or len(self._light) >= self._most_messages or size > self._most_bytes:
                self._refused += 1
                return False
            self._light.append(message)
            self._bytes = size
            return True

    def take_light(self, now: float, size: int) -> list[QueuedQos0]:
        """Remove and return what of QoS 0 may be written next, about ``size`` bytes; drop what is late."""
        taken: list[QueuedQos0] = []
        with self._lock:
            while self._light and size > 0:
                message = self._light.popleft()
                self._bytes -= _size(message)
                if message.is_late(now):
                    self._refused += 1
                    continue
                taken.append(message)
                size -= len(message.where.topic) + len(message.payload)
        return taken

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

    def _queued(self) -> QueueStats:
        """Return the figures."""
        return QueueStats(len(self), self._bytes, self._refused + self.spool.lost)


def _size(message: QueuedQos0) -> int:
    """Return the bytes that a message of QoS 0 costs while it waits."""
    return len(message.where.topic) + len(message.payload) + OVERHEAD
