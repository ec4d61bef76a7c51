"""Copies of the frames of this process's links for a recorder; nothing is copied without one.

A link reads ``note`` of its ``LinkTap`` before each frame; it is None while there is no recorder. A note only
appends to a bounded queue: it cannot block or fail a link. Frames beyond the bound are dropped and counted.
"""

from __future__ import annotations

import contextvars
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal, Protocol
from weakref import WeakSet

import msgspec

from fleet.clock import Clock
from fleet.link.base import Address

log = logging.getLogger(__name__)

Direction = Literal["open", "in", "out"]
Redaction = Callable[[bytes], bytes]
"""Overwrites secrets in the bytes of one direction of one link; returns as many bytes as it gets."""

MOST_WAITING = 8 * 1024 * 1024
"""Bytes that may wait for publication; further frames are dropped and counted."""
OVERHEAD = 200  # bytes of memory of a frame besides its data
STEP = 32  # frames in one step of a flush
LARGEST = 128 * 1024  # bytes of frames in one message


class LinkFrame(msgspec.Struct, frozen=True, omit_defaults=True):
    """One frame: Unix s, from the robot (``in``) or to it (``out``), its bytes, and its peer for datagrams.

    ``open``: the link was opened then; there are no bytes. ``peer`` is HOST:PORT.
    """

    at: float
    direction: Direction = msgspec.field(name="way")  # as in recordings of all versions
    data: bytes = b""
    peer: str = ""


class LinkFrames(msgspec.Struct, frozen=True, omit_defaults=True):
    """Frames of one link, in order; ``robot`` is the one that opened it.

    ``number`` counts the messages of one process, so that a gap reveals a lost one; ``dropped`` counts the
    frames that did not fit.
    """

    stamp: float
    robot: str
    link: str
    frames: list[LinkFrame]
    number: int = 0
    dropped: int = 0


class TapCallback(Protocol):
    """Takes a copy of a frame, from any thread; never raises."""

    def __call__(
        self, direction: Direction, data: bytes, address: Address = None, *, at: float | None = None
    ) -> None:
        """Take direction, bytes and peer; ``at`` (Unix s) if it was not now."""


class LinkTap:
    """Copies the frames of one open link; ``note`` is None while there is no recorder."""

    __slots__ = ("__weakref__", "link", "note", "redactions", "robot")

    def __init__(self, robot: str = "", link: str = "") -> None:
        self.robot = robot
        self.link = link
        self.note: TapCallback | None = None
        self.redactions: dict[Direction, Redaction] = {}


class FrameTap:
    """The copied frames of all links of one process, until they are published."""

    def __init__(self, clock: Clock) -> None:
        self.is_on = False
        self._clock = clock
        self._links: WeakSet[LinkTap] = WeakSet()
        self._waiting: deque[tuple[LinkTap, float, Direction, bytes, Address]] = deque()
        self._size = 0
        self._lock = threading.Lock()  # guards the queue and its size, which several threads change
        self._dropped = 0
        self._number = 0

    def open(self, robot: str, link: str, redaction: Callable[[], Redaction | None]) -> LinkTap:
        """Return the tap of a link that is being opened."""
        tap = LinkTap(robot, link)
        for direction in ("in", "out"):
            redact = redaction()
            if redact is not None:
                tap.redactions[direction] = redact
        self._links.add(tap)
        if self.is_on:
            tap.note = partial(self._enqueue, tap)
            tap.note("open", b"")
        return tap

    def switch(self, *, on: bool) -> None:
        """Start or stop copying; on the event loop."""
        if on == self.is_on:
            return
        with self._lock:
            self.is_on = on
            self._waiting.clear()
            self._size = 0
        for tap in list(self._links):
            tap.note = partial(self._enqueue, tap) if on else None

    def _enqueue(
        self,
        tap: LinkTap,
        direction: Direction,
        data: bytes,
        address: Address = None,
        *,
        at: float | None = None,
    ) -> None:
        """Queue a copy of a frame; from any thread, even just after the recorder has left."""
        frame = tap, self._clock.time() if at is None else at, direction, data, address
        with self._lock:
            if not self.is_on:
                return
            if self._size > MOST_WAITING:
                self._dropped += 1
                return
            self._size += len(data) + OVERHEAD
            self._waiting.append(frame)

    def _next(self) -> tuple[LinkTap, float, Direction, bytes, Address] | None:
        """Return the oldest queued frame, None if there is none."""
        with self._lock:
            if not self._waiting:
                return None
            frame = self._waiting.popleft()
            self._size -= len(frame[3]) + OVERHEAD
            return frame

    def flushing(self, put: Callable[[bytes], None]) -> Iterator[None]:
        """Publish all queued frames in steps; each message is a ``LinkFrames`` as JSON."""
        by_link: dict[LinkTap, list[LinkFrame]] = {}
        sizes: dict[LinkTap, int] = {}
        for count in range(1, len(self._waiting) + 1):
            frame = self._next()
            if frame is None:
                break
            tap, at, direction, data, address = frame
            shown = self._redacted(tap, direction, data)
            if shown is None:
                continue
            by_link.setdefault(tap, []).append(LinkFrame(at, direction, shown, peer_of(address)))
            sizes[tap] = sizes.get(tap, 0) + len(data)
            if sizes[tap] > LARGEST:
                put(self._message(tap, by_link.pop(tap)))
                del sizes[tap]
            if count % STEP == 0:
                yield
        for tap, frames in by_link.items():
            put(self._message(tap, frames))
            yield

    def _redacted(self, tap: LinkTap, direction: Direction, data: bytes) -> bytes | None:
        """Return the bytes without secrets, None (the frame is dropped) when an adapter's redaction fails."""
        redact = tap.redactions.get(direction)
        if redact is None:
            return data
        try:
            return redact(data)
        except Exception:
            if not self._dropped:
                log.exception("the redaction of %s failed: frames are not recorded", tap.link)
            self._dropped += 1
            return None

    def _message(self, tap: LinkTap, frames: list[LinkFrame]) -> bytes:
        """Return the message for the frames of one link."""
        self._number += 1
        made = LinkFrames(frames[0].at, tap.robot, tap.link, frames, self._number, self._dropped)
        return msgspec.json.encode(made)


def peer_of(address: Address) -> str:
    """Return the address of a datagram's peer as HOST:PORT, empty for a stream."""
    return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else ""


OPENING: contextvars.ContextVar[Callable[[str], LinkTap] | None] = contextvars.ContextVar(
    "opening", default=None
)
"""Factory for the tap of a link that a robot opens; None where nothing is recorded."""


def tap_of(link: str) -> LinkTap:
    """Return the tap of a link that is being opened; called in the task of its robot."""
    opening = OPENING.get()
    return opening(link) if opening is not None else LinkTap()
