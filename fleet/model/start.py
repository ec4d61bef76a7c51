"""What is said to start several robots at one instant: the question for it, and the answer of a process.

Each robot was prepared before, under the ``id`` of the start. Stamps are Unix seconds.
"""

from __future__ import annotations

import msgspec

from fleet.errors import Refused

CLOCKS_WITHIN = 0.02  # s by which the clock of a process may be off, the error of measuring it counted
PINGS = 8  # questions by which a clock is measured; the fastest counts
AT_LEAST = 0.5  # s from the question to the instant: it has to reach everyone before
FARTHEST = 600.0  # s to the instant at the most; what is to begin later is a schedule's


class StartAsked(msgspec.Struct, frozen=True, omit_defaults=True):
    """Begin at ``stamp`` what was prepared under ``id``; without an id only the clock is asked."""

    id: str = ""
    stamp: float = 0.0


class StartAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a process says: its clock, and of each robot that it had prepared why it will not begin.

    An empty reason: it begins at the stamp.
    """

    process: str
    time: float
    robots: dict[str, str] = {}


class Offset(msgspec.Struct, frozen=True):
    """How far a clock is from ours (s, positive: ahead), and how far off that may be (s)."""

    seconds: float
    bound: float

    @property
    def worst(self) -> float:
        """The farthest that it may be from ours, s."""
        return abs(self.seconds) + self.bound


def offset_of(sent: float, told: float, received: float) -> Offset:
    """Return a clock's offset by one question: ``told`` is what it said between ``sent`` and ``received``.

    The answer may have been given at any moment between the two, so half of that time is the bound.
    """
    return Offset(told - (sent + received) / 2, max(received - sent, 0.0) / 2)


def check_clock(where: str, offset: Offset | None) -> None:
    """Raise Refused for the clock of a process that is not ours, or that nobody could measure."""
    if offset is None:
        raise Refused(f"{where} does not tell its time: nobody is started")
    if offset.worst > CLOCKS_WITHIN:
        raise Refused(
            f"the clock of {where} is {offset.seconds * 1000:+.0f} ms from ours (within "
            f"{offset.bound * 1000:.0f} ms), {CLOCKS_WITHIN * 1000:.0f} ms are the most: nobody is started",
            hint="synchronise the clocks, by NTP or PTP",
        )
