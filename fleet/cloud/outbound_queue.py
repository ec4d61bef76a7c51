"""What waits to be sent: durable messages in the spool, and light ones (QoS 0), which never wait offline.

The spool sends replies first, then status, then events; light ones go behind them, in every write. A full
queue of QoS 0 refuses new messages.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterable, Sequence

import msgspec

from fleet.clock import Clock
from fleet.cloud.packets import Protocol
from fleet.cloud.publish import PublishRoute, publish_light, publish_route, renewed
from fleet.cloud.values import CloudStats, QueueStats
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool


class Batch(msgspec.Struct, gc=False):
    """Messages of QoS 0 that were queued together: where each goes, and its packet.

    ``since`` is when (monotonic s) they were queued, ``size`` the bytes that the packets then had.
    """

    where: Sequence[PublishRoute]
    packets: Sequence[bytes]
    since: float
    size: int


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
        self._light: deque[Batch] = deque()
        self._messages = 0
        self._steady = math.inf  # s for which no message of QoS 0 is to be looked at again
        stats.outbox = self._queued
        self._bytes = 0
        self._refused = 0
        self._online = False

    def __len__(self) -> int:
        return self._messages + self.spool.waiting

    def address(self, topic: str, expiry: float | None, protocol: Protocol) -> PublishRoute:
        """Return where messages of QoS 0 go; raises ValueError for what is no topic."""
        where = publish_route(topic, expiry, protocol)
        with self._lock:
            self._steady = min(self._steady, where.steady)
        return where

    def put_light(self, where: Sequence[PublishRoute], payloads: Sequence[bytes]) -> bool:
        """Add messages of QoS 0, all or none; tell whether they were taken.

        What is durable is put into the spool.
        """
        packets = list(map(publish_light, where, payloads))
        light_batch = Batch(where, packets, self._clock.monotonic(), sum(map(len, packets)))
        with self._lock:
            queued, size = (
                self._messages + len(packets),
                self._bytes + light_batch.size + OVERHEAD * len(packets),
            )
            if not self._online or queued > self._most_messages or size > self._most_bytes:
                self._refused += len(packets)
                return False
            self._light.append(light_batch)
            self._messages, self._bytes = queued, size
            return True

    def take_light(self, now: float, size: int) -> list[Batch]:
        """Remove and return what of QoS 0 may be written next, about ``size`` bytes; drop what is late."""
        taken: list[Batch] = []
        with self._lock:
            while self._light and size > 0:
                light_batch = self._light.popleft()
                taken.append(light_batch)
                size -= light_batch.size
                self._bytes -= light_batch.size + OVERHEAD * len(light_batch.packets)
                self._messages -= len(light_batch.packets)
        for light_batch in taken:
            if now - light_batch.since >= self._steady:
                self._renew(light_batch, now - light_batch.since)
        return taken

    def _renew(self, light_batch: Batch, waited: float) -> None:
        """Have messages tell what is left of their time, and drop those of which nothing is."""
        renewing = [
            (each, renewed(each, packet, waited))
            for each, packet in zip(light_batch.where, light_batch.packets, strict=True)
        ]
        timely = [(each, packet) for each, packet in renewing if packet is not None]
        with self._lock:
            self._refused += len(renewing) - len(timely)
        light_batch.where, light_batch.packets = (
            [each for each, _ in timely],
            [packet for _, packet in timely],
        )

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
            self._refused += self._messages
            self._light.clear()
            self._messages = self._bytes = 0

    def _queued(self) -> QueueStats:
        """Return the figures."""
        return QueueStats(len(self), self._bytes, self._refused + self.spool.lost)
