"""Queries on many keys of one pattern, such as the command keys of all robots, answered by one queryable."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from typing import Generic, TypeVar

from fleet.bus.zenoh_session import Query, ZenohSession, keys_intersect

log = logging.getLogger(__name__)

OwnerT = TypeVar("OwnerT")


class QueryTable(Generic[OwnerT]):
    """Calls ``call`` with each query on a key of the table, and the owner of the key, such as a robot.

    All keys match ``pattern``; ``call`` and ``more`` are as in ``ZenohSession.answer``. It is one queryable,
    not one per key, of which each takes 6 kB in the sessions of an edge. A query that matches the pattern and
    no key gets no reply. With ``apart`` each key has its own queryable: the process then receives no queries
    for the robots of other processes, which would reach these only after this process has run.
    """

    def __init__(
        self,
        bus_session: ZenohSession,
        pattern: str,
        call: Callable[[OwnerT, Query], None],
        *,
        more: str = "",
        apart: bool = False,
    ) -> None:
        self._bus_session, self._call, self._more, self._apart = bus_session, call, more, apart
        self._owners: dict[str, OwnerT] = {}
        self._ends: dict[str, Callable[[], None]] = {}  # of the keys apart
        if not apart:
            bus_session.declare_queryable(pattern, self._requested_for_many, more=more)

    def add(self, key: str, owner: OwnerT) -> None:
        """Answer the queries on a key from now on; a key has one owner, the newest."""
        self._owners[key] = owner
        if self._apart and key not in self._ends:
            self._ends[key] = self._bus_session.declare_queryable(
                key, self._requested_for_one, more=self._more
            )

    def remove(self, key: str) -> None:
        """Stop answering queries on a key; no effect on an unknown one."""
        self._owners.pop(key, None)
        if end := self._ends.pop(key, None):
            end()

    def _requested_for_one(self, query: Query) -> None:
        """Answer a query for the key of its queryable; on the bus's thread."""
        owner = self._owners.get(query.key)
        if owner is None:  # it has just been removed
            query.close()
        else:
            self._answer(owner, query)

    def _requested_for_many(self, query: Query) -> None:
        """Answer a query for each of the keys that it asks for, separately; on the bus's thread."""
        owners = self._owners.copy()  # at once: keys come and go on another thread
        found = requested_keys(query.requested, query.suffix, owners, self._more)
        if not found:
            query.close()
        for part in query.split(found):
            self._answer(owners[part.key], part)

    def _answer(self, owner: OwnerT, query: Query) -> None:
        """Answer a query on one key; a failure does not keep those on other keys from being answered."""
        try:
            self._call(owner, query)
        except Exception:
            log.exception("a query on %s failed", query.key)
            query.close()


def requested_keys(requested: str, suffix: str, known: Collection[str], more: str) -> list[str]:
    """Return the known keys that a query asks for: ``requested`` is its key expression, without ``suffix``.

    A query with a suffix asks for the keys with ``more`` appended.
    """
    whole, rest = requested + suffix, more if suffix else ""
    if "*" not in whole:
        return [requested] if requested in known else []
    return [key for key in known if keys_intersect(whole, key + rest)]
