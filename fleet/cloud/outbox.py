"""What waits to be sent: bounded, in three lanes, the more important one first.

| lane | what waits there | when the queue is full |
|---|---|---|
| urgent | replies and stops | goes last |
| lasting | QoS 1 | the oldest is dropped |
| light | QoS 0 | the new one is refused; nothing waits while the connection is down |
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable

import msgspec

from fleet.cloud.values import CloudStats, Outcome

OVERHEAD = 200
"""Bytes that one waiting message costs besides its payload."""


class Outgoing(msgspec.Struct, eq=False):
    """One message on its way out; ``deadline`` is monotonic, ``again`` means that it was sent before."""

    topic: str
    payload: bytes
    qos: int
    urgent: bool = False
    deadline: float | None = None
    correlation: bytes | None = None
    content_type: str | None = None
    on_done: Callable[[Outcome], None] | None = None
    again: bool = False
    size: int = 0

    def __post_init__(self) -> None:
        """Note what it costs in memory, in bytes."""
        self.size = len(self.payload) + OVERHEAD


class Outbox:
    """The queue between any thread that publishes and the cloud thread that writes."""

    def __init__(self, messages: int, size: int, stats: CloudStats) -> None:
        self._most_messages = messages
        self._most_bytes = size
        self._lock = threading.Lock()
        self._urgent: deque[Outgoing] = deque()
        self._lasting: deque[Outgoing] = deque()
        self._light: deque[Outgoing] = deque()
        self._stats = stats
        self._dropped: list[Outgoing] = []
        self._online = False
        self._closed = False

    def __len__(self) -> int:
        return self._stats.queued

    def put(self, message: Outgoing) -> bool:
        """Add a message; tell whether it was taken. QoS 1 pushes the oldest out rather than be refused."""
        with self._lock:
            taken = self._make_room(message)
            if taken:
                self._lane(message).append(message)
                self._add(message)
            else:
                self._stats.dropped += 1
            return taken

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return what may be written next, about ``size`` bytes of it.

        ``window`` is how many more QoS 1 messages may be under way; the last ``reserve`` are for urgent ones.
        """
        batch: list[Outgoing] = []
        with self._lock:
            window, size = self._move(batch, self._urgent, now, window, size)
            _, size = self._move(batch, self._lasting, now, window - reserve, size)
            self._move(batch, self._light, now, 1, size)
        return batch

    def put_back(self, messages: Iterable[Outgoing]) -> None:
        """Put messages that were sent but not acknowledged, oldest first, before all others of their lane."""
        with self._lock:
            for message in reversed(list(messages)):
                message.again = True
                self._lane(message).appendleft(message)
                self._add(message)

    def go_online(self) -> None:
        """From now on QoS 0 is taken."""
        self._online = True

    def go_offline(self) -> None:
        """Drop QoS 0 and take no more of it."""
        with self._lock:
            self._online = False
            for lane in (self._urgent, self._light):
                self._keep(lane, lambda message: message.qos > 0)

    def expire(self, now: float) -> None:
        """Drop what ran out of time."""
        with self._lock:
            for lane in (self._urgent, self._lasting, self._light):
                self._keep(lane, lambda message: message.deadline is None or message.deadline > now)

    def close(self) -> None:
        """Drop everything and take nothing more."""
        with self._lock:
            self._closed = True
            for lane in (self._urgent, self._lasting, self._light):
                self._keep(lane, lambda _: False)

    def take_dropped(self) -> list[Outgoing]:
        """Remove and return what was dropped since the last call, so that its sender can be told."""
        if not self._dropped:
            return []
        with self._lock:
            dropped, self._dropped = self._dropped, []
        return dropped

    def _lane(self, message: Outgoing) -> deque[Outgoing]:
        """Return where a message waits."""
        if message.urgent:
            return self._urgent
        return self._lasting if message.qos else self._light

    def _make_room(self, message: Outgoing) -> bool:
        """Tell whether there is room for a message, after pushing older ones out for it."""
        if self._closed or message.size > self._most_bytes or not (message.qos or self._online):
            return False
        stats = self._stats
        while stats.queued >= self._most_messages or stats.queued_bytes + message.size > self._most_bytes:
            if not (message.qos and self._drop_oldest(urgent=message.urgent)):
                return False
        return True

    def _drop(self, message: Outgoing) -> None:
        """Note a message that will not be sent."""
        self._dropped.append(message)
        self._stats.dropped += 1

    def _add(self, message: Outgoing) -> None:
        """Count a message in."""
        self._stats.queued += 1
        self._stats.queued_bytes += message.size

    def _pop(self, lane: deque[Outgoing]) -> Outgoing:
        """Take the oldest of a lane and count it out."""
        message = lane.popleft()
        self._stats.queued -= 1
        self._stats.queued_bytes -= message.size
        return message

    def _drop_oldest(self, *, urgent: bool) -> bool:
        """Make room: light ones first, urgent ones only for an urgent one. Tell whether there was any."""
        for lane in (self._light, self._lasting, self._urgent if urgent else None):
            if lane:
                self._drop(self._pop(lane))
                return True
        return False

    def _move(
        self, batch: list[Outgoing], lane: deque[Outgoing], now: float, window: int, size: int
    ) -> tuple[int, int]:
        """Move messages of a lane into the batch; return the window and the bytes that are left."""
        while lane and size > 0 and (window > 0 or not lane[0].qos):
            message = self._pop(lane)
            if message.deadline is not None and message.deadline <= now:
                self._drop(message)
                continue
            batch.append(message)
            size -= message.size
            window -= message.qos > 0
        return window, size

    def _keep(self, lane: deque[Outgoing], wanted: Callable[[Outgoing], bool]) -> None:
        """Drop from a lane what is not wanted."""
        for _ in range(len(lane)):
            message = self._pop(lane)
            if wanted(message):
                lane.append(message)
                self._add(message)
            else:
                self._drop(message)
