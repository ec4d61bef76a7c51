"""What is said to start several robots at one instant: the question for it, and the answer of a process.

Each robot was prepared before, under the ``id`` of the start. Stamps are Unix seconds.
"""

from __future__ import annotations

import msgspec

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
