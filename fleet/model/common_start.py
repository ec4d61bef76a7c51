"""Common start of several robots: the request for it, and the answer of each process.

Each robot was prepared before, under the ``id`` of the start. Stamps are Unix seconds.
"""

from __future__ import annotations

import msgspec

from fleet.errors import Refused

CLOCKS_WITHIN = 0.02  # s by which the clock of a process may differ, including the measuring error
PINGS = 8  # requests to measure a clock; the fastest counts
AT_LEAST = 0.5  # s from the request to the instant: it must reach every process before
FARTHEST = 600.0  # s to the instant at the most; later starts are the task of schedules


class StartSignal(msgspec.Struct, frozen=True, omit_defaults=True):
    """Start the robots prepared under ``id`` at ``stamp``; without an id only the clock is requested."""

    id: str = ""
    stamp: float = 0.0


class StartAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """Answer of a process: its clock, and for each robot that it had prepared why it will not start.

    An empty reason: the robot starts at the stamp.
    """

    process: str
    time: float
    robots: dict[str, str] = {}


class ClockOffset(msgspec.Struct, frozen=True):
    """Offset of another clock from ours (s, positive: ahead), and the bound of its error (s)."""

    seconds: float
    bound: float

    @property
    def worst(self) -> float:
        """The largest possible difference between the clocks, s."""
        return abs(self.seconds) + self.bound


def offset_of(sent: float, shown: float, received: float) -> ClockOffset:
    """Return a clock's offset from one request: it showed ``shown`` between ``sent`` and ``received``.

    The answer may have been made at any moment between the two, so half of that time is the bound.
    """
    return ClockOffset(shown - (sent + received) / 2, max(received - sent, 0.0) / 2)


def check_clock(where: str, offset: ClockOffset | None) -> None:
    """Raise Refused for the clock of a process that differs too much, or that could not be measured."""
    if offset is None:
        raise Refused(f"{where} does not report its time: no robot is started")
    if offset.worst > CLOCKS_WITHIN:
        raise Refused(
            f"the clock of {where} is {offset.seconds * 1000:+.0f} ms from ours (within "
            f"{offset.bound * 1000:.0f} ms), {CLOCKS_WITHIN * 1000:.0f} ms are the most: no robot is started",
            hint="synchronise the clocks, by NTP or PTP",
        )
