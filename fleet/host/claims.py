"""Which edge has a twin, on the bus: a token says so, and the later one gives way.

An edge that finds a twin taken does not run its robot until the other lets go. Where two claimed it at once,
or met only later (the network between them was cut), the one that claimed first keeps it; both come to the
same result, because both see the same two tokens.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable

import msgspec

from fleet.bus import keys
from fleet.bus.lane import Lane
from fleet.clock import Clock

log = logging.getLogger(__name__)

SETTLE = 0.5  # s in which tokens of edges on other computers come in before a twin is claimed


class Claim(msgspec.Struct, frozen=True, order=True):
    """Since when (Unix milliseconds) which edge says that it has a twin; the smaller one has it."""

    began: int
    edge: str


def holder(mine: Claim | None, others: Iterable[Claim]) -> str:
    """Return the edge that has a twin before us, empty when none has.

    ``mine`` is None while we have not claimed it.
    """
    before = [other for other in others if mine is None or other < mine]
    return min(before).edge if before else ""


def read_claim(key: str) -> tuple[str, Claim] | None:
    """Return twin and claim of a token's key; None when it is none."""
    parts = key.split("/")
    if len(parts) != 5 or parts[0] != "fleet" or parts[2] != "claims" or not parts[4].isdecimal():
        return None
    return parts[3], Claim(int(parts[4]), parts[1])


class Claims:
    """The claims of one process for its edge's twins. On the loop only.

    ``changed`` hears twin and holder, empty when the twin is ours, once for each twin at the start and then
    for each change. ``settle`` is how many seconds to listen before claiming.
    """

    def __init__(
        self,
        edge: str,
        twins: Iterable[str],
        lane: Lane,
        *,
        settle: float,
        changed: Callable[[str, str], None],
        clock: Clock,
    ) -> None:
        self._edge = edge
        self._lane = lane
        self._settle = settle
        self._changed = changed
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._others: dict[str, set[Claim]] = {twin: set() for twin in twins}
        self._mine: dict[str, tuple[Claim, Callable[[], None]]] = {}
        self._told: dict[str, str] = {}
        self._began = False

    def add(self, twins: Iterable[str]) -> None:
        """Claim these twins too (of robots in workers); before ``start``."""
        for twin in twins:
            self._others[twin] = set()

    def start(self) -> None:
        """Listen, and claim what is free; at once when nobody is far away."""
        self._lane.watch_tokens(keys.claims(), self._seen)
        if self._settle:
            self._loop.call_later(self._settle, self._begin)
        else:
            self._begin()

    def _begin(self) -> None:
        """Claim every twin that is free."""
        self._began = True
        for twin in self._others:
            self._look(twin)

    def _seen(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus calls it so
        """Note a token that came or went; on the bus's thread."""
        read = read_claim(key)
        if read is not None and read[1].edge != self._edge and read[0] in self._others:
            self._loop.call_soon_threadsafe(self._note, *read, alive)

    def _note(self, twin: str, claim: Claim, alive: bool) -> None:  # noqa: FBT001 - handed on
        """Take another edge's claim into account."""
        (self._others[twin].add if alive else self._others[twin].discard)(claim)
        if self._began:
            self._look(twin)

    def _look(self, twin: str) -> None:
        """Claim a twin, give it up, or wait for it, as the tokens are now."""
        mine, take_back = self._mine.get(twin, (None, None))
        before = holder(mine, self._others[twin])
        if before and take_back is not None:
            del self._mine[twin]
            take_back()
        elif not before and mine is None:
            claim = Claim(int(self._clock.time() * 1000), self._edge)
            self._mine[twin] = claim, self._lane.token(keys.claim(self._edge, twin, claim.began))
        if self._told.get(twin) != before:
            self._told[twin] = before
            self._changed(twin, before)
