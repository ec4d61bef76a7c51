"""Outbound messages: durable ones in the spool, and QoS 0 messages, which are never kept while offline.

The spool sends replies first, then status, then events. Each write also has a share for QoS 0. A full QoS 0
queue refuses new messages.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable

from fleet.clock import Clock
from fleet.cloud.publish import Qos0Route, QueuedQos0
from fleet.cloud.values import CloudStats, QueueStats
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool


class OutboundQueue:
    """The queue between the publishing threads and the loop that writes.

    ``messages`` and ``size`` (bytes) bound the QoS 0 queue.
    """

    def __init__(self, spool: Spool, messages: int, size: int, stats: CloudStats, clock: Clock) -> None:
        self.spool = spool
        self._clock = clock
        self._most_messages = messages
        self._most_bytes = size
        self._lock = threading.Lock()
        self._qos0: deque[QueuedQos0] = deque()
        stats.outbox = self._queued
        self._bytes = 0
        self._refused = 0
        self._online = False

    def __len__(self) -> int:
        return len(self._qos0) + self.spool.waiting

    def put_qos0(self, route: Qos0Route, payload: bytes) -> bool:
        """Queue a QoS 0 message; return whether it was accepted.

        Durable messages go to the spool directly.
        """
        message = QueuedQos0(route, payload, self._clock.monotonic())
        with self._lock:
            size = self._bytes + _size(message)
            if not self._online or len(self._qos0) >= self._most_messages or size > self._most_bytes:
                self._refused += 1
                return False
            self._qos0.append(message)
            self._bytes = size
            return True

    def take_qos0(self, now: float, size: int) -> list[QueuedQos0]:
        """Remove and return the next QoS 0 messages, about ``size`` bytes; drop expired ones."""
        taken: list[QueuedQos0] = []
        with self._lock:
            while self._qos0 and size > 0:
                message = self._qos0.popleft()
                self._bytes -= _size(message)
                if message.is_late(now):
                    self._refused += 1
                    continue
                taken.append(message)
                size -= len(message.route.topic) + len(message.payload)
        return taken

    @property
    def waits(self) -> bool:
        """True while QoS 0 messages wait."""
        return bool(self._qos0)

    def go_online(self) -> None:
        """Start to accept QoS 0."""
        self._online = True
        self.spool.go_online()

    def go_offline(self, unanswered: Iterable[Outgoing]) -> None:
        """Take back the unacknowledged messages, oldest first; drop QoS 0 and refuse new ones."""
        self.spool.requeue(unanswered)
        self.spool.go_offline()
        self._drop_qos0()

    def tick(self) -> None:
        """Run the periodic work of the spool; about once a second."""
        self.spool.tick()

    def close(self) -> None:
        """Refuse new messages; durable ones stay on disk."""
        self._drop_qos0()
        self.spool.close()

    @property
    def idle(self) -> bool:
        """True when there is nothing to send now."""
        return not self._qos0 and self.spool.idle

    def _drop_qos0(self) -> None:
        """Drop all QoS 0 messages and refuse new ones."""
        with self._lock:
            self._online = False
            self._refused += len(self._qos0)
            self._qos0.clear()
            self._bytes = 0

    def _queued(self) -> QueueStats:
        """Return the statistics."""
        return QueueStats(len(self), self._bytes, self._refused + self.spool.lost)


def _size(message: QueuedQos0) -> int:
    """Return the memory, in bytes, of a waiting QoS 0 message."""
    return len(message.route.topic) + len(message.payload) + OVERHEAD
