"""Present view of all edges of a bus, from their tokens and summaries and the list of edges seen before."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from functools import partial
from typing import Self

import msgspec

from fleet.bus import keys
from fleet.client.edges import ANSWER_WITHIN, Edges
from fleet.client.seen_edges import SeenEdges
from fleet.clock import Clock
from fleet.errors import FleetError, StateError, WireError
from fleet.health.rollup import SeenEdge
from fleet.model.summary import LARGEST, decode

log = logging.getLogger(__name__)

MOST = 20_000
"""Limit of watched edges; further ones are refused and reported."""
SURE_AFTER = 0.3
"""Seconds from the loss of a token until its edge counts as gone: our own link may have failed."""
KEEP_EVERY = 60.0  # s between writes of the list of seen edges
REFUSALS_SHOWN = 3


class FleetWatch:
    """The edges of a bus; ``problems`` describes errors that limit the view.

    Joins the edges of this computer, or that of a fleet file, and joins again when that set changes. While no
    edge is joined, all edges are marked unseen; those that ran on this computer are marked gone.
    """

    def __init__(self, file: str | None, clock: Clock) -> None:
        self.problems: list[str] = []
        self.joined: tuple[str, ...] = ()
        self._file = file
        self._clock = clock
        self._register = SeenEdges(file)
        self._lock = threading.Lock()
        self._edges: dict[str, SeenEdge] = {}
        self._refused: dict[str, str] = {}
        self._tokens: dict[str, set[int]] = {}  # by edge: the sessions that show its token
        self._ended: dict[str, float] = {}  # when the token of an edge ended
        self._link: Edges | None = None
        self._seen_at = clock.time()
        self._save_at = 0.0
        self._register_problems = self._load()
        self._saved = set(self._edges)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._disconnect()
        self._save()

    def update(self) -> list[SeenEdge]:
        """Update the view and return all edges."""
        if self._link is not None and not self._is_current(self._link):
            self._disconnect()
        joined = self._link is not None or self._join()
        now = self._clock.time()
        with self._lock:
            if joined:
                self._seen_at = now
                self._end_expired_tokens(now)
            found = sorted(self._edges.values(), key=lambda edge: edge.edge)
            refused = [f"edge {edge}: {why}" for edge, why in list(self._refused.items())[:REFUSALS_SHOWN]]
        if self._link is not None:
            self.problems = [*self._link.unreached, *self._register_problems, *refused]
        if self._clock.monotonic() >= self._save_at:
            self._save()
        return found if joined else [msgspec.structs.replace(edge, unseen=self._seen_at) for edge in found]

    # -- joining -------------------------------------------------------------------------------------------

    def _is_current(self, link: Edges) -> bool:
        """Return True if all joined edges are still reached and no other edge runs here."""
        return link.are_all(self._file) and all(session.reached() for session in link.sessions)

    def _join(self) -> bool:
        """Join the running edges and read their state; return False and set ``problems`` if there is none."""
        began = self._clock.time()
        try:
            link = Edges.reach(self._file)
        except FleetError as error:
            self.problems = [str(error)]
            self._mark_local_gone()
            return False
        self._link, self.joined = link, link.joined
        for number, session in enumerate(link.sessions):
            session.subscribe(keys.summary("*"), self._on_summary)
            session.watch_tokens(keys.edge("*"), partial(self._on_token, number))
        answers = [
            session.request(keys.summary("*"), b"", timeout=ANSWER_WITHIN) for session in link.sessions
        ]
        for number, session in enumerate(link.sessions):
            for key in session.tokens(keys.edge("*"), timeout=ANSWER_WITHIN):
                self._on_token(number, key, True)
        for each in answers:
            for key, payload in each:
                self._on_summary(key, payload)
        self._settle(began)
        return True

    def _settle(self, began: float) -> None:
        """After a join, mark the edges that are gone, and those that are alive but did not answer."""
        with self._lock:
            for name, edge in self._edges.items():
                if name not in self._tokens:
                    self._edges[name] = self._gone(edge)
                elif edge.heard < began:
                    self._edges[name] = msgspec.structs.replace(edge, changed=0.0)

    def _mark_local_gone(self) -> None:
        """Mark the edges of this computer as gone, since none runs here any more."""
        with self._lock:
            for name in self.joined if self._file is None else ():
                self._edges[name] = self._gone(self._edges.get(name) or SeenEdge(name, True, self._seen_at))

    def _gone(self, edge: SeenEdge) -> SeenEdge:
        """Return an edge as gone since it was last seen, or since earlier if it was gone already."""
        last = max(edge.heard, edge.changed, self._seen_at) if edge.alive else edge.changed
        return msgspec.structs.replace(edge, alive=False, changed=last)

    def _disconnect(self) -> None:
        """Close the connection to the edges; it does not mark any as gone."""
        if self._link is not None:
            self._link.__exit__()
        self._link = None
        with self._lock:
            self._tokens.clear()
            self._ended.clear()

    # -- callbacks, on the threads of the bus --------------------------------------------------------------

    def _on_token(self, session: int, key: str, alive: bool) -> None:  # noqa: FBT001 - signature of the bus callback
        """Record the appearance or loss of an edge's token on a session."""
        name = key.split("/")[1]
        now = self._clock.time()
        with self._lock:
            if not self._has_room(name):
                return
            shown = self._tokens.setdefault(name, set())
            (shown.add if alive else shown.discard)(session)
            if not shown:
                del self._tokens[name]
                self._ended.setdefault(name, now)
                return
            self._ended.pop(name, None)
            edge = self._edges.get(name) or SeenEdge(name, False, now)
            if not edge.alive:
                self._edges[name] = msgspec.structs.replace(edge, alive=True, changed=now)

    def _on_summary(self, key: str, payload: bytes) -> None:
        """Decode and store a summary."""
        name = key.split("/")[1]
        try:
            summary = decode(payload, name)
        except WireError as error:
            self._refuse(name, str(error)[:LARGEST])
            return
        now = self._clock.time()
        with self._lock:
            if self._has_room(name):
                edge = self._edges.get(name) or SeenEdge(name, True, now)
                self._edges[name] = msgspec.structs.replace(edge, summary=summary, heard=now)
                self._refused.pop(name, None)

    def _refuse(self, name: str, why: str) -> None:
        """Record a refused summary, and log the first in a row."""
        with self._lock:
            if not self._has_room(name):
                return
            is_new, self._refused[name] = name not in self._refused, why
        if is_new:
            log.warning("edge %s: %s", name, why)

    def _has_room(self, name: str) -> bool:
        """Return True if another edge may be watched; call with the lock held."""
        if name in self._edges or len(self._edges) < MOST:
            return True
        self._refused.setdefault("(others)", f"more than {MOST} edges; the others are not shown")
        return False

    def _end_expired_tokens(self, now: float) -> None:
        """Mark edges as gone whose token ended SURE_AFTER ago; call with the lock held."""
        for name, since in list(self._ended.items()):
            if now - since >= SURE_AFTER:
                del self._ended[name]
                edge = self._edges.get(name) or SeenEdge(name, False, since)
                self._edges[name] = msgspec.structs.replace(edge, alive=False, changed=since)

    # -- list of seen edges on disk ------------------------------------------------------------------------

    def _load(self) -> list[str]:
        """Load the edges seen before as gone; return the error if they cannot be read."""
        try:
            known = self._register.read()
        except StateError as error:
            return [str(error)]
        self._edges = {name: msgspec.structs.replace(edge, alive=False) for name, edge in known.items()}
        return []

    def _save(self) -> None:
        """Write the list of seen edges, with the present time for those that are alive.

        Edges that are gone, and that a person removed from the list meanwhile, are no longer shown.
        """
        self._save_at = self._clock.monotonic() + KEEP_EVERY
        try:
            forgotten = self._saved - self._register.read().keys()
            with self._lock:
                for name in forgotten & self._edges.keys():
                    if not self._edges[name].alive:
                        del self._edges[name]
                seen = [self._as_saved(edge) for edge in self._edges.values()]
            self._register.save(seen)
            self._saved = {edge.edge for edge in seen}
        except StateError as error:
            self._register_problems = [str(error)]
        else:
            self._register_problems = []

    def _as_saved(self, edge: SeenEdge) -> SeenEdge:
        """Return an edge as it is written: if alive, with the time at which it was last seen."""
        seen = max(edge.changed, self._seen_at)
        return msgspec.structs.replace(edge, changed=seen) if edge.alive else edge


def of_sites(edges: Iterable[SeenEdge], joined: Iterable[str], site: str | None) -> list[SeenEdge]:
    """Return the edges of one site: the given one, or the sites of the joined edges.

    Edges of an unknown site are included.
    """
    edges = list(edges)
    here = {edge.summary.site for edge in edges if edge.edge in set(joined) and edge.summary}
    sites = {site} if site is not None else here or {""}
    return [edge for edge in edges if edge.summary is None or edge.summary.site in sites]
