"""The lease of a pair of edges: which may command the robots, and until when. Pure: the clock is an argument.

The lease is one entry of a store with compare-and-set. Its holder renews it by writes; each write counts from
the moment at which it was *begun*. Another edge takes the lease only when it has seen the same revision for
the whole length of the lease, and a revision is seen only after its write was begun. So the holder's time
ends first, whatever the clocks of the two computers and of the store show; their rates must agree within a
twelfth (``LeaseTimes``). Times are seconds of a clock per computer that also advances while the computer is
suspended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum

import msgspec


class LeaseState(StrEnum):
    """The role of an edge."""

    STANDBY = "standby"  # does not hold the lease; no link to a robot is open
    HOLDER = "holder"  # runs the robots
    FENCED = "fenced"  # its lease ends: it halts its robots and closes their links


class LeaseEvent(StrEnum):
    """Events of the state machine."""

    TAKEN = "taken"  # the store has confirmed our entry in time
    LAPSED = "lapsed"  # no renewal was confirmed in time
    LOST = "lost"  # the entry is another edge's, or gone
    HANDOVER = "handover"  # on request, or because this edge shuts down
    ROBOTS_RELEASED = "let go"  # every robot has been released


TRANSITIONS: Mapping[tuple[LeaseState, LeaseEvent], LeaseState] = {
    (LeaseState.STANDBY, LeaseEvent.TAKEN): LeaseState.HOLDER,
    (LeaseState.HOLDER, LeaseEvent.LAPSED): LeaseState.FENCED,
    (LeaseState.HOLDER, LeaseEvent.LOST): LeaseState.FENCED,
    (LeaseState.HOLDER, LeaseEvent.HANDOVER): LeaseState.FENCED,
    (LeaseState.FENCED, LeaseEvent.ROBOTS_RELEASED): LeaseState.STANDBY,
}
"""Other events change nothing. Fenced never returns to holder directly: that takes a new epoch."""


class LeaseTimes(msgspec.Struct, frozen=True):
    """The times of a lease, s.

    ``standstill``: motion ends this long before the end of the lease. ``margin``: writes to robots end this
    long before it.
    """

    length: float = 3.0
    renewed_every: float = 0.5
    standstill: float = 1.0
    margin: float = 0.25


class LeaseEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The stored lease.

    ``process`` is one run of an edge; ``epoch`` the revision with which it took the lease, 0 in that write
    itself; ``stops`` the robots whose emergency stop is set, with the causes. ``released``: the robots were
    released in order; ``to`` is the edge that shall take it then, empty for any. ``config`` is the digest of
    robots and missions in its file; empty if unknown.
    """

    edge: str
    process: str
    epoch: int = 0
    released: bool = False
    to: str = ""
    stops: dict[str, str] = {}
    config: str = ""


class LeaseAction(StrEnum):
    """The next write of an edge."""

    TAKE = "take"
    RENEW = "renew"
    RELEASE = "release"


class Takeover(msgspec.Struct, frozen=True):
    """Knowledge of the previous holder when this edge took the lease.

    ``entry`` was first seen at ``since``; None: there was none. ``orderly``: the robots had been released.
    """

    entry: LeaseEntry | None = None
    since: float = 0.0
    orderly: bool = False


class _Write(msgspec.Struct, frozen=True):
    """A pending write since ``began_at``, and the takeover that it would complete."""

    action: LeaseAction
    began_at: float
    after: Takeover


class Lease:
    """One edge's view of the lease. All methods are called on one thread."""

    def __init__(self, edge: str, process: str, terms: LeaseTimes, config: str = "") -> None:
        self.edge = edge
        self.process = process
        self.terms = terms
        self.config = config
        self.accepted = ""  # digest of a different file from whose edge a takeover is permitted
        self.state = LeaseState.STANDBY
        self.epoch = 0
        self.seen: LeaseEntry | None = None  # the last entry read, or written by us
        self.revision = 0  # of that entry, or of its deletion; 0: there never was one
        self.seen_since = math.inf  # when this revision was first seen
        self.renewed_at = -math.inf  # when our last confirmed write was begun
        self.takeover = Takeover()  # how we last came to hold it
        self._write: _Write | None = None
        self._unanswered = False  # the result of a write of ours is unknown
        self._to: str | None = None  # edge to hand the lease to; None: no handover

    # -- time limits ---------------------------------------------------------------------------------

    @property
    def motion_until(self) -> float:
        """When motion must end unless a renewal is confirmed before."""
        if self.state is not LeaseState.HOLDER:
            return -math.inf
        return self.renewed_at + self.terms.length - self.terms.standstill

    @property
    def writes_until(self) -> float:
        """When the last byte must have been written to a robot."""
        if self.state is LeaseState.STANDBY:
            return -math.inf
        return self.renewed_at + self.terms.length - self.terms.margin

    def tick(self, now: float) -> None:
        """Handle the passage of time."""
        if self.state is LeaseState.HOLDER and now >= self.motion_until:
            self._happens(LeaseEvent.LAPSED)

    # -- reads ---------------------------------------------------------------------------------------

    def observe(self, entry: LeaseEntry | None, revision: int, now: float) -> None:
        """Handle an entry that was read. Without an entry, ``revision`` is that of its deletion, or 0."""
        if self.seen_since == math.inf or (revision, entry) != (self.revision, self.seen):
            self.seen, self.revision, self.seen_since = entry, revision, now
        self._unanswered = False
        if not self._is_ours():
            self._happens(LeaseEvent.LOST)
            self._to = None

    @property
    def needs_read(self) -> bool:
        """True if the store must be read before anything is written."""
        return self.state is not LeaseState.HOLDER or self._unanswered

    def next_write(self, now: float, *, stops_changed: bool = False) -> LeaseAction | None:
        """Return the next write, if any; ``stops_changed``: the stops differ from those in the entry."""
        if self._write is not None or self._unanswered or self.seen_since == math.inf:
            return None
        if self.state is LeaseState.HOLDER:
            return (
                LeaseAction.RENEW
                if stops_changed or now >= self.renewed_at + self.terms.renewed_every
                else None
            )
        if self.state is LeaseState.FENCED:
            return None
        if self._to is not None:
            return LeaseAction.RELEASE
        return LeaseAction.TAKE if self._is_free(now) and not self.differs else None

    @property
    def differs(self) -> bool:
        """True while the last holder is another edge with a different file: its robots are not taken over."""
        seen = self.seen
        if seen is None or seen.edge == self.edge or not seen.config or not self.config:
            return False
        return seen.config not in (self.config, self.accepted)

    def _is_ours(self) -> bool:
        """Return True while this process holds the lease in the last seen entry."""
        return self.seen is not None and self.seen.process == self.process and not self.seen.released

    def _is_free(self, now: float) -> bool:
        """Return True if no edge can hold the lease any more; our own entry counts as released."""
        if self._is_ours():
            return True
        seen = self.seen
        if seen is not None and seen.released and seen.process != self.process:
            return seen.to in ("", self.edge) or now >= self.seen_since + self.terms.length
        return now >= self.seen_since + self.terms.length

    # -- writes --------------------------------------------------------------------------------------

    def begin(self, next_write: LeaseAction, stops: dict[str, str], now: float) -> LeaseEntry:
        """Return the entry to write in place of ``revision``; pass the result to one of the next methods."""
        orderly = self._is_ours() or (self.seen is not None and self.seen.released)
        self._write = _Write(next_write, now, Takeover(self.seen, self.seen_since, orderly))
        if next_write is LeaseAction.TAKE:
            return LeaseEntry(self.edge, self.process, stops=stops, config=self.config)
        released = next_write is LeaseAction.RELEASE
        return LeaseEntry(self.edge, self.process, self.epoch, released, self._to or "", stops, self.config)

    def written(self, entry: LeaseEntry, revision: int, now: float) -> None:
        """Handle the confirmation of a write."""
        write, self._write = self._write, None
        assert write is not None
        self.seen, self.revision, self.seen_since = entry, revision, now
        if write.action is LeaseAction.RELEASE:
            self._to = None
        elif write.action is LeaseAction.RENEW and self.state is LeaseState.HOLDER:
            self.renewed_at = write.began_at
        elif (
            write.action is LeaseAction.TAKE
            and now < write.began_at + self.terms.length - self.terms.standstill
        ):
            self.renewed_at, self.epoch = write.began_at, revision
            self.takeover = write.after
            self._happens(LeaseEvent.TAKEN)

    def refused(self) -> None:
        """Handle a refused write: the revision has changed, so the entry must be read."""
        self._write, self._unanswered = None, True

    unanswered = refused
    """Handle a write with an unknown result: the entry must be read too."""

    # -- requests ------------------------------------------------------------------------------------

    def hand_over(self, to: str) -> None:
        """Begin to hand the lease over to another edge, or to any (empty)."""
        if self.state is LeaseState.HOLDER:
            self._to = to
            self._happens(LeaseEvent.HANDOVER)

    def accept(self) -> None:
        """Permit a takeover from the present or last holder, although its file differs."""
        self.accepted = self.seen.config if self.seen is not None else ""

    def robots_released(self) -> None:
        """Report that every robot was released: no link is open. The other edge need not wait then."""
        if self.state is LeaseState.FENCED:
            self._to = self._to or ""
            self._happens(LeaseEvent.ROBOTS_RELEASED)

    def _happens(self, event: LeaseEvent) -> None:
        """Change the state by the table."""
        self.state = TRANSITIONS.get((self.state, event), self.state)
