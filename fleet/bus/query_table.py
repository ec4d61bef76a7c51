"""Queries on many keys of one pattern, such as the command keys of all robots, each with its own function."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection

from fleet.bus.zenoh_session import Query, ZenohSession, keys_intersect

log = logging.getLogger(__name__)

OnQuery = Callable[[Query], None]


class QueryTable:
    """Answers the queries on its keys, which all match ``pattern``; ``more`` as in ``ZenohSession.answer``.

    It is one queryable, not one per key, of which each takes 6 kB in the sessions of an edge. A query that
    matches the pattern and none of the keys gets no reply. With ``apart`` each key has its own queryable:
    the process then receives no queries for the robots of others, which could not end before it has run.
    """

    def __init__(
        self, bus_session: ZenohSession, pattern: str, *, more: str = "", apart: bool = False
    ) -> None:
        self._bus_session, self._more, self._apart = bus_session, more, apart
        self._calls: dict[str, OnQuery] = {}
        if not apart:
            bus_session.answer(pattern, self.asked, more=more)

    def add(self, key: str, call: OnQuery) -> Callable[[], None]:
        """Call ``call`` with each query on ``key``, as ``ZenohSession.answer``; return how to end it.

        A key has one function: the newest.
        """
        if self._apart:
            return self._bus_session.answer(key, call, more=self._more)
        self._calls[key] = call

        def end() -> None:
            if self._calls.get(key) is call:
                del self._calls[key]

        return end

    def asked(self, query: Query) -> None:
        """Pass a query on to the functions of its keys; on the bus's thread.

        Each gets a query of its own. The failure of one does not keep the others from being called.
        """
        calls = self._calls.copy()  # at once: keys come and go on another thread
        found = asked_keys(query.asked, query.suffix, calls, self._more)
        if not found:
            query.close()
        for part in query.divided(found):
            try:
                calls[part.key](part)
            except Exception:
                log.exception("a query on %s failed", part.key)
                part.close()


def asked_keys(asked: str, suffix: str, known: Collection[str], more: str) -> list[str]:
    """Return the known keys that a query asks for: ``asked`` is its key expression, without ``suffix``.

    A query with a suffix asks for the keys with ``more`` appended.
    """
    whole, rest = asked + suffix, more if suffix else ""
    if "*" not in whole:
        return [asked] if asked in known else []
    return [key for key in known if keys_intersect(whole, key + rest)]
