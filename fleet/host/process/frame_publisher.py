"""Publishes the frames on the links of one process while a recorder subscribes to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.link.tap import FrameTap, LinkTap, Redaction

EVERY = 0.1
"""Seconds between checks for a recorder, and between messages of one link."""


class FramePublisher:
    """Publishes on one key the frames of links that are opened with ``opening``."""

    def __init__(self, key: str, bus_session: ZenohSession, clock: Clock) -> None:
        self.tap = FrameTap(clock)
        self._publisher = bus_session.publisher(key)
        self._clock = clock
        self._due = clock.monotonic()

    def opening(self, robot: str, redaction: Callable[[], Redaction | None]) -> Callable[[str], LinkTap]:
        """Return the factory of taps for the links of a robot."""
        return partial(self.tap.open, robot, redaction=redaction)

    def flushing(self) -> Iterator[None]:
        """Publish waiting frames, a few per step; called at the end of each tick."""
        now = self._clock.monotonic()
        if now < self._due:
            return
        self._due = now + EVERY
        self.tap.switch(on=self._publisher.wanted)
        if self.tap.is_on:
            yield from self.tap.flushing(self._publisher.put)
