"""What waits to be sent: durable messages in the spool, and light ones (QoS 0), which never wait offline.

The spool sends replies first, then status, then events; light ones go with what is left of a write. A full
light lane refuses what is new.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable

from fleet.cloud.values import CloudStats, Queued
from fleet.spool.message import Outcome, Outgoing
from fleet.spool.spool import Spool


class Outbox:
    """The queue between any thread that publishes and the loop that writes.

    ``messages`` and ``size`` (bytes) bound the light lane.
    """

    def __init__(self, spool: Spool, messages: int, size: int, stats: CloudStats) -> None:
        self.spool = spool
        self._most_messages = messages
        self._most_bytes = size
        self._lock = threading.Lock()
        self._light: deque[Outgoing] = deque()
        stats.outbox = self._queued
        self._bytes = 0
        self._refused = 0
        self._dropped: list[tuple[Outgoing, Outcome]] = []
        self._online = False
        self._closed = False

    def __len__(self) -> int:
        return len(self._light) + self.spool.waiting

    def put(self, message: Outgoing) -> bool:
        """Add a message; tell whether it was taken."""
        return self.spool.put(message) if message.qos else self._put_light(message)

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return what may be written next, about ``size`` bytes of it.

        ``window`` is how many more QoS 1 messages may be under way; the last ``reserve`` are for replies.
        """
        batch = self.spool.take(now, window=window, reserve=reserve, size=size)
        size -= sum(message.size for message in batch)
        with self._lock:
            while self._light and size > 0:
                message = self._light.popleft()
                self._bytes -= message.size
                if message.deadline is not None and message.deadline <= now:
                    self._drop(message)
                    continue
                batch.append(message)
                size -= message.size
        return batch

    def go_online(self) -> None:
        """From now on QoS 0 is taken."""
        self._online = True
        self.spool.go_online()

    def go_offline(self, unanswered: Iterable[Outgoing]) -> None:
        """Take back what was not acknowledged, oldest first; drop QoS 0 and take no more of it."""
        self._online = False
        self.spool.put_back(unanswered)
        self.spool.go_offline()
        self._drop_light()

    def tick(self) -> None:
        """Look after time: once a second or so."""
        self.spool.tick()

    def close(self) -> None:
        """Take nothing more; what is durable stays on disk."""
        self._closed = True
        self.spool.close()
        self._drop_light()

    def take_dropped(self) -> list[tuple[Outgoing, Outcome]]:
        """Remove and return what was dropped since the last call, so that its sender can be told."""
        with self._lock:
            dropped, self._dropped = self._dropped, []
        return [*dropped, *self.spool.take_dropped()]

    @property
    def idle(self) -> bool:
        """True when nothing could be sent now."""
        return not self._light and self.spool.idle

    def _put_light(self, message: Outgoing) -> bool:
        """Add a message of QoS 0."""
        with self._lock:
            fits = len(self._light) < self._most_messages and self._bytes + message.size <= self._most_bytes
            taken = self._online and fits and not self._closed
            if taken:
                self._light.append(message)
                self._bytes += message.size
            else:
                self._refused += 1
        return taken

    def _drop_light(self) -> None:
        """Drop all of QoS 0."""
        with self._lock:
            while self._light:
                self._drop(self._light.popleft())
            self._bytes = 0

    def _drop(self, message: Outgoing) -> None:
        """Note a light message that will not be sent."""
        self._dropped.append((message, Outcome.DROPPED))
        self._refused += 1

    def _queued(self) -> Queued:
        """Return the figures."""
        return Queued(len(self), self._bytes, self._refused + self.spool.lost)
