"""The lease of a pair of edges: who may command the robots, and until when. Pure: the clock is handed in.

The lease is one entry of a store with compare-and-set. Its holder writes it again and again; each write
counts from the moment at which it was *begun*. Another edge takes the lease only when it has seen the same
revision for the whole length of the lease, and a revision is seen only after its write was begun. So the
holder's time ends first, whatever the clocks of the two computers and of the store say; their rates must
agree within a twelfth (``Terms``). Times are seconds of one clock per computer that also counts while it is
suspended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum

import msgspec


class LeaseState(StrEnum):
    """What an edge is to its robots."""

    STANDBY = "standby"  # it does not hold the lease, and no link to a robot is open
    HOLDER = "holder"  # it runs the robots
    FENCED = "fenced"  # its lease ends: it halts its robots and closes their links


class LeaseEvent(StrEnum):
    """What changes the state."""

    TAKEN = "taken"  # the store has confirmed our entry in time
    LAPSED = "lapsed"  # no renewal was confirmed in time
    LOST = "lost"  # the entry is another edge's, or gone
    HANDOVER = "handover"  # somebody asked for it, or this edge ends
    LET_GO = "let go"  # every robot has been let go of


TRANSITIONS: Mapping[tuple[LeaseState, LeaseEvent], LeaseState] = {
    (LeaseState.STANDBY, LeaseEvent.TAKEN): LeaseState.HOLDER,
    (LeaseState.HOLDER, LeaseEvent.LAPSED): LeaseState.FENCED,
    (LeaseState.HOLDER, LeaseEvent.LOST): LeaseState.FENCED,
    (LeaseState.HOLDER, LeaseEvent.HANDOVER): LeaseState.FENCED,
    (LeaseState.FENCED, LeaseEvent.LET_GO): LeaseState.STANDBY,
}
"""Any other event changes nothing. No way leads from fenced back to holder: that takes a new epoch."""


class Terms(msgspec.Struct, frozen=True):
    """The times of a lease, s.

    ``standstill``: before the end of the lease, motion ends. ``margin``: before its end, nothing more is
    written to a robot.
    """

    length: float = 3.0
    renewed_every: float = 0.5
    standstill: float = 1.0
    margin: float = 0.25


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The lease as it is stored.

    ``process`` is one run of an edge; ``epoch`` the revision with which it took the lease, 0 in that write
    itself; ``stops`` the robots whose emergency stop is set, with the cause. ``released``: the robots were
    let go of in order; ``to`` is the edge that shall take it then, empty for any. ``config`` is the digest of
    what its file says of robots and missions; empty from an edge that does not tell it.
    """

    edge: str
    process: str
    epoch: int = 0
    released: bool = False
    to: str = ""
    stops: dict[str, str] = {}
    config: str = ""


class Wish(StrEnum):
    """What an edge wants to write now."""

    TAKE = "take"
    RENEW = "renew"
    RELEASE = "release"


class Takeover(msgspec.Struct, frozen=True):
    """What was known of the holder before when this edge took the lease.

    ``entry`` was seen first at ``since``; None: there was none. ``orderly``: the robots had been let go of.
    """

    entry: Entry | None = None
    since: float = 0.0
    orderly: bool = False


class _Write(msgspec.Struct, frozen=True):
    """A write that is under way since ``begun``, and what it takes the lease over from."""

    wish: Wish
    begun: float
    after: Takeover


class Lease:
    """One edge's part in the lease. All methods are called on one thread."""

    def __init__(self, edge: str, process: str, terms: Terms, config: str = "") -> None:
        self.edge = edge
        self.process = process
        self.terms = terms
        self.config = config
        self.accepted = ""  # the digest of another file, from whose edge the robots are taken nevertheless
        self.state = LeaseState.STANDBY
        self.epoch = 0
        self.seen: Entry | None = None  # the last entry that was read, or written by us
        self.revision = 0  # of that entry, or of its deletion; 0: there never was one
        self.seen_since = math.inf  # when this revision was seen first
        self.vouched = -math.inf  # when our last confirmed write was begun
        self.takeover = Takeover()  # how we came to hold it last
        self._write: _Write | None = None
        self._unanswered = False  # a write of ours may have been carried out, or may still be
        self._to: str | None = None  # whom the lease is handed to; None: it is not handed over

    # -- what follows from the time ------------------------------------------------------------------

    @property
    def motion_until(self) -> float:
        """When motion must end unless a renewal is confirmed before."""
        if self.state is not LeaseState.HOLDER:
            return -math.inf
        return self.vouched + self.terms.length - self.terms.standstill

    @property
    def writes_until(self) -> float:
        """When the last byte must have been written to a robot."""
        if self.state is LeaseState.STANDBY:
            return -math.inf
        return self.vouched + self.terms.length - self.terms.margin

    def tick(self, now: float) -> None:
        """Note that time has passed."""
        if self.state is LeaseState.HOLDER and now >= self.motion_until:
            self._happens(LeaseEvent.LAPSED)

    # -- what the store says -------------------------------------------------------------------------

    def see(self, entry: Entry | None, revision: int, now: float) -> None:
        """Take what was read. Where there is no entry, ``revision`` is that of its deletion, or 0."""
        if self.seen_since == math.inf or (revision, entry) != (self.revision, self.seen):
            self.seen, self.revision, self.seen_since = entry, revision, now
        self._unanswered = False
        if not self._is_ours():
            self._happens(LeaseEvent.LOST)
            self._to = None

    @property
    def must_look(self) -> bool:
        """True when the store is to be read before anything is written."""
        return self.state is not LeaseState.HOLDER or self._unanswered

    def wish(self, now: float, *, news: bool = False) -> Wish | None:
        """Return what is to be written now, if anything; ``news``: the stops are not those of the entry."""
        if self._write is not None or self._unanswered or self.seen_since == math.inf:
            return None
        if self.state is LeaseState.HOLDER:
            return Wish.RENEW if news or now >= self.vouched + self.terms.renewed_every else None
        if self.state is LeaseState.FENCED:
            return None
        if self._to is not None:
            return Wish.RELEASE
        return Wish.TAKE if self._is_free(now) and not self.differs else None

    @property
    def differs(self) -> bool:
        """True while the last holder is another edge with another file: its robots are not taken over."""
        seen = self.seen
        if seen is None or seen.edge == self.edge or not seen.config or not self.config:
            return False
        return seen.config not in (self.config, self.accepted)

    def _is_ours(self) -> bool:
        """Return True while the entry that was seen last says that this process holds the lease."""
        return self.seen is not None and self.seen.process == self.process and not self.seen.released

    def _is_free(self, now: float) -> bool:
        """Return True when no edge can hold the lease any more. Of our own entry we have let go."""
        if self._is_ours():
            return True
        seen = self.seen
        if seen is not None and seen.released and seen.process != self.process:
            return seen.to in ("", self.edge) or now >= self.seen_since + self.terms.length
        return now >= self.seen_since + self.terms.length

    # -- what is written -----------------------------------------------------------------------------

    def begin(self, wish: Wish, stops: dict[str, str], now: float) -> Entry:
        """Return the entry to write in the place of ``revision``; its outcome is told to one of the next."""
        orderly = self._is_ours() or (self.seen is not None and self.seen.released)
        self._write = _Write(wish, now, Takeover(self.seen, self.seen_since, orderly))
        if wish is Wish.TAKE:
            return Entry(self.edge, self.process, stops=stops, config=self.config)
        released = wish is Wish.RELEASE
        return Entry(self.edge, self.process, self.epoch, released, self._to or "", stops, self.config)

    def written(self, entry: Entry, revision: int, now: float) -> None:
        """Take the confirmation of a write."""
        write, self._write = self._write, None
        assert write is not None
        self.seen, self.revision, self.seen_since = entry, revision, now
        if write.wish is Wish.RELEASE:
            self._to = None
        elif write.wish is Wish.RENEW and self.state is LeaseState.HOLDER:
            self.vouched = write.begun
        elif write.wish is Wish.TAKE and now < write.begun + self.terms.length - self.terms.standstill:
            self.vouched, self.epoch = write.begun, revision
            self.takeover = write.after
            self._happens(LeaseEvent.TAKEN)

    def refused(self) -> None:
        """Take it that the entry was not of that revision any more: it must be read."""
        self._write, self._unanswered = None, True

    unanswered = refused
    """Nobody knows whether a write was carried out, or will be: the entry must be read, too."""

    # -- what is asked -------------------------------------------------------------------------------

    def hand_over(self, to: str) -> None:
        """Begin to give the lease to another edge, or to any (empty)."""
        if self.state is LeaseState.HOLDER:
            self._to = to
            self._happens(LeaseEvent.HANDOVER)

    def accept(self) -> None:
        """Take over from who holds the lease, or held it last, though its file is another."""
        self.accepted = self.seen.config if self.seen is not None else ""

    def let_go(self) -> None:
        """Note that every robot was let go of: no link is open. The other edge need not wait then."""
        if self.state is LeaseState.FENCED:
            self._to = self._to or ""
            self._happens(LeaseEvent.LET_GO)

    def _happens(self, event: LeaseEvent) -> None:
        """Change the state."""
        self.state = TRANSITIONS.get((self.state, event), self.state)
