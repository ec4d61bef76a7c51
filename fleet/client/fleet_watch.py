"""All edges of a bus as they are now: their tokens and summaries, and those seen before that are gone."""

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
"""Edges that are watched; more are refused, and told."""
SURE_AFTER = 0.3
"""Seconds from the end of a token to the word that its edge is gone: our own link may have ended."""
KEEP_EVERY = 60.0  # s between two writes of the edges that were seen
REFUSALS_TOLD = 3


class FleetWatch:
    """The edges of a bus; ``problems`` says what keeps us from seeing them.

    Joins what runs on this computer, or what a fleet file reaches, and joins again when that changes. While
    nothing is joined, the edges are unseen; those that ran on this computer are gone.
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
        self._ended: dict[str, float] = {}  # edges without a token, since when
        self._link: Edges | None = None
        self._seen_at = clock.time()
        self._keep_at = 0.0
        self._unkept = self._recall()
        self._kept = set(self._edges)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._leave()
        self._keep()

    def look(self) -> list[SeenEdge]:
        """Return the edges as they are now."""
        if self._link is not None and not self._is_whole(self._link):
            self._leave()
        joined = self._link is not None or self._join()
        now = self._clock.time()
        with self._lock:
            if joined:
                self._seen_at = now
                self._let_go(now)
            found = sorted(self._edges.values(), key=lambda edge: edge.edge)
            refused = [f"edge {edge}: {why}" for edge, why in list(self._refused.items())[:REFUSALS_TOLD]]
        if self._link is not None:
            self.problems = [*self._link.unreached, *self._unkept, *refused]
        if self._clock.monotonic() >= self._keep_at:
            self._keep()
        return found if joined else [msgspec.structs.replace(edge, unseen=self._seen_at) for edge in found]

    # -- joining -------------------------------------------------------------------------------------------

    def _is_whole(self, link: Edges) -> bool:
        """Return whether all that we joined is still reached, and nothing else runs here."""
        return link.are_all(self._file) and all(session.reached() for session in link.sessions)

    def _join(self) -> bool:
        """Join what runs, and learn how it is; return False, with the reason told, when nothing does."""
        began = self._clock.time()
        try:
            link = Edges.reach(self._file)
        except FleetError as error:
            self.problems = [str(error)]
            self._end_those_of_here()
            return False
        self._link, self.joined = link, link.joined
        for number, session in enumerate(link.sessions):
            session.subscribe(keys.summary("*"), self._told)
            session.watch_tokens(keys.edge("*"), partial(self._token, number))
        answers = [session.ask(keys.summary("*"), b"", timeout=ANSWER_WITHIN) for session in link.sessions]
        for number, session in enumerate(link.sessions):
            for key in session.tokens(keys.edge("*"), timeout=ANSWER_WITHIN):
                self._token(number, key, True)
        for each in answers:
            for key, payload in each:
                self._told(key, payload)
        self._settle(began)
        return True

    def _settle(self, began: float) -> None:
        """Note which edges are gone, and which are there and did not answer, after a join."""
        with self._lock:
            for name, edge in self._edges.items():
                if name not in self._tokens:
                    self._edges[name] = self._gone(edge)
                elif edge.heard < began:
                    self._edges[name] = msgspec.structs.replace(edge, changed=0.0)

    def _end_those_of_here(self) -> None:
        """Note the edges that ran on this computer as gone: none runs here any more."""
        with self._lock:
            for name in self.joined if self._file is None else ():
                self._edges[name] = self._gone(self._edges.get(name) or SeenEdge(name, True, self._seen_at))

    def _gone(self, edge: SeenEdge) -> SeenEdge:
        """Return an edge as gone since it was seen last, or longer, if it was gone already."""
        last = max(edge.heard, edge.changed, self._seen_at) if edge.alive else edge.changed
        return msgspec.structs.replace(edge, alive=False, changed=last)

    def _leave(self) -> None:
        """Close what was joined; nobody is gone by that."""
        if self._link is not None:
            self._link.__exit__()
        self._link = None
        with self._lock:
            self._tokens.clear()
            self._ended.clear()

    # -- on the bus's threads ------------------------------------------------------------------------------

    def _token(self, session: int, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus calls it so
        """Note the token of an edge that a session shows, or no longer shows."""
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

    def _told(self, key: str, payload: bytes) -> None:
        """Take a summary."""
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
        """Note a summary that was refused, and log the first in a row."""
        with self._lock:
            if not self._has_room(name):
                return
            is_new, self._refused[name] = name not in self._refused, why
        if is_new:
            log.warning("edge %s: %s", name, why)

    def _has_room(self, name: str) -> bool:
        """Return whether another edge may be watched; with the lock held."""
        if name in self._edges or len(self._edges) < MOST:
            return True
        self._refused.setdefault("(others)", f"more than {MOST} edges; the others are not shown")
        return False

    def _let_go(self, now: float) -> None:
        """Note the edges whose token ended a moment ago as gone; with the lock held."""
        for name, since in list(self._ended.items()):
            if now - since >= SURE_AFTER:
                del self._ended[name]
                edge = self._edges.get(name) or SeenEdge(name, False, since)
                self._edges[name] = msgspec.structs.replace(edge, alive=False, changed=since)

    # -- what was seen before ------------------------------------------------------------------------------

    def _recall(self) -> list[str]:
        """Take the edges that were seen before as gone; return why they are not known."""
        try:
            known = self._register.read()
        except StateError as error:
            return [str(error)]
        self._edges = {name: msgspec.structs.replace(edge, alive=False) for name, edge in known.items()}
        return []

    def _keep(self) -> None:
        """Write the edges that were seen, with the moment at which those that live were seen last.

        One that is gone, and was forgotten by a person meanwhile, is no longer shown.
        """
        self._keep_at = self._clock.monotonic() + KEEP_EVERY
        try:
            forgotten = self._kept - self._register.read().keys()
            with self._lock:
                for name in forgotten & self._edges.keys():
                    if not self._edges[name].alive:
                        del self._edges[name]
                seen = [self._as_kept(edge) for edge in self._edges.values()]
            self._register.keep(seen)
            self._kept = {edge.edge for edge in seen}
        except StateError as error:
            self._unkept = [str(error)]
        else:
            self._unkept = []

    def _as_kept(self, edge: SeenEdge) -> SeenEdge:
        """Return an edge as it is written: one that lives with the moment at which it was seen."""
        seen = max(edge.changed, self._seen_at)
        return msgspec.structs.replace(edge, changed=seen) if edge.alive else edge


def of_sites(edges: Iterable[SeenEdge], joined: Iterable[str], site: str | None) -> list[SeenEdge]:
    """Return the edges of one site: the given one, or those of the edges that were joined.

    An edge whose site is not known is one of them.
    """
    edges = list(edges)
    here = {edge.summary.site for edge in edges if edge.edge in set(joined) and edge.summary}
    sites = {site} if site is not None else here or {""}
    return [edge for edge in edges if edge.summary is None or edge.summary.site in sites]
