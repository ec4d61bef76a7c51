"""Claims of twins on the bus, by liveliness tokens, so that no two edges run a robot at once.

An edge requests a twin with a token, and waits twice the time that a token may take to be seen. It claims the
twin (with another token) only if meanwhile no other edge had it or requested it before. So at least one of
two edges sees the other in time (docs/adr/0013-claims-on-twins.md). If the network was partitioned and both
claimed it, both see that later: the edge with the later request gives way, once its robot does not move.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock

log = logging.getLogger(__name__)

SEEN_WITHIN = 1.0  # s in which others see a token: an edge tries to reach them every 0.5 s
SETTLE = 2 * SEEN_WITHIN  # s for which a twin is requested before it is claimed
LOOK_AGAIN = 0.25  # s between checks whether a robot that must be given up still moves


class TwinClaim(msgspec.Struct, frozen=True, order=True):
    """Request of an edge for a twin, since ``began`` (Unix ms); the smallest wins. ``held``: claimed."""

    began: int
    edge: str
    held: bool = False


class _Mine(msgspec.Struct):
    """Our claim on a twin, and the function that removes its token."""

    claim: TwinClaim
    take_back: Callable[[], None]


def holder(mine: TwinClaim | None, others: Iterable[TwinClaim]) -> str:
    """Return the edge that has a twin, or will get it before us; empty for none.

    ``mine`` is None while we do not request it. A holder keeps it; of two holders, or two requests, the
    earlier request wins.
    """
    before = [other for other in others if mine is None or _precedes(other, mine)]
    return min(before, key=lambda claim: (not claim.held, claim)).edge if before else ""


def _precedes(other: TwinClaim, mine: TwinClaim) -> bool:
    """Return True when another edge's claim has precedence over ours."""
    if other.held != mine.held:
        return other.held
    return (other.began, other.edge) < (mine.began, mine.edge)


def read_claim(key: str) -> tuple[str, TwinClaim] | None:
    """Return twin and claim of a token's key; None for any other key."""
    parts = key.split("/")
    if len(parts) != 5 or parts[0] != "fleet" or parts[2] != "claims":
        return None
    since = parts[4].removesuffix(keys.HELD)
    return (parts[3], TwinClaim(int(since), parts[1], since != parts[4])) if since.isdecimal() else None


class TwinClaims:
    """Claims of one process for its edge's twins. On the event loop only.

    ``changed`` gets twin and holder, empty when the twin is ours, once it is known and at each change.
    ``settle`` is how many seconds a twin is requested before it is claimed: 0 where there is no other edge.
    ``moves`` returns whether this edge moves the twin's robot, which is then not given up.
    """

    def __init__(
        self,
        edge: str,
        twins: Iterable[str],
        bus_session: ZenohSession,
        *,
        settle: float,
        changed: Callable[[str, str], None],
        moves: Callable[[str], bool],
        clock: Clock,
    ) -> None:
        self._edge = edge
        self._bus_session = bus_session
        self._settle = settle
        self._changed = changed
        self._moves = moves
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._others: dict[str, set[TwinClaim]] = {twin: set() for twin in twins}
        self._mine: dict[str, _Mine] = {}
        self._reported: dict[str, str] = {}
        self.pair: frozenset[str] = frozenset()  # edges of the pair, whose lease decides instead
        self._added: dict[str, Callable[[], None]] = {}  # ends the subscription of a twin added later
        self._looking: set[str] = set()  # twins with a pending check

    def add(self, twins: Iterable[str]) -> None:
        """Claim these twins too (of robots in workers); before ``start``."""
        for twin in twins:
            self._others[twin] = set()

    def start(self) -> None:
        """Subscribe to tokens, and claim free twins."""
        self._bus_session.watch_tokens(keys.claims(), self._seen)
        for twin in self._others:
            self._update_claim(twin)

    def begin(self, twin: str) -> None:
        """Claim one more twin, after ``start``."""
        if twin not in self._others:
            self._others[twin] = set()
            # Only a new subscriber receives the tokens that existed before.
            self._added[twin] = self._bus_session.watch_tokens(keys.claims(twin), self._seen)
            self._update_claim(twin)

    def give_up(self, twin: str) -> None:
        """Stop claiming a twin."""
        for table in (self._others, self._reported):
            table.pop(twin, None)
        if end := self._added.pop(twin, None):
            end()
        if mine := self._mine.pop(twin, None):
            mine.take_back()

    def _seen(self, key: str, alive: bool) -> None:  # noqa: FBT001 - signature of the bus
        """Receive a token's appearance or end; on the bus's thread."""
        read = read_claim(key)
        if read is None or read[1].edge in self.pair:
            return
        if read[1].edge != self._edge and read[0] in self._others:
            self._loop.call_soon_threadsafe(self._note, *read, alive)

    def _note(self, twin: str, claim: TwinClaim, alive: bool) -> None:  # noqa: FBT001 - passed on
        """Record another edge's claim."""
        if twin not in self._others:  # it has just been given up
            return
        (self._others[twin].add if alive else self._others[twin].discard)(claim)
        self._update_claim(twin)

    def _update_claim(self, twin: str) -> None:
        """Request a twin, give it up, or wait for it, according to the present tokens."""
        if twin not in self._others:  # it has been given up
            return
        mine = self._mine.get(twin)
        before = holder(mine.claim if mine else None, self._others[twin])
        if mine is None and not before:
            self._want(twin)
        elif mine is not None and before:
            if mine.claim.held and self._moves(twin):
                self._look_later(twin)
                return
            del self._mine[twin]
            mine.take_back()
            # The edge that had precedence may only have requested it, and be gone since.
            self._loop.call_soon(self._update_claim, twin)
        if before:
            self._report_holder(twin, before)

    def _look_later(self, twin: str) -> None:
        """Check again soon; at most one such check is pending."""
        if twin not in self._looking:
            self._looking.add(twin)
            self._loop.call_later(LOOK_AGAIN, self._look_again, twin)

    def _look_again(self, twin: str) -> None:
        self._looking.discard(twin)
        self._update_claim(twin)

    def _want(self, twin: str) -> None:
        """Request a twin, and claim it if no other edge objects within the settling time."""
        claim = TwinClaim(int(self._clock.time() * 1000), self._edge)
        if not self._settle:
            self._hold(twin, claim)  # without a request before: Zenoh does not give its memory back
            self._report_holder(twin, "")
            return
        self._mine[twin] = _Mine(claim, self._bus_session.token(keys.claim(self._edge, twin, claim.began)))
        self._loop.call_later(self._settle, self._have, twin, claim)

    def _have(self, twin: str, claim: TwinClaim) -> None:
        """Claim a twin that was requested for the whole settling time."""
        mine = self._mine.get(twin)
        if mine is None or mine.claim != claim:
            return
        self._hold(twin, claim)
        mine.take_back()
        self._report_holder(twin, "")

    def _hold(self, twin: str, claim: TwinClaim) -> None:
        """Show that this edge has a twin."""
        has = self._bus_session.token(keys.claim(self._edge, twin, claim.began, held=True))
        self._mine[twin] = _Mine(msgspec.structs.replace(claim, held=True), has)

    def _report_holder(self, twin: str, who: str) -> None:
        """Report the holder of a twin if it changed."""
        if self._reported.get(twin) != who:
            self._reported[twin] = who
            self._changed(twin, who)
