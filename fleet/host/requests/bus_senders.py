"""Senders that act for a person, and the person's permissions, from the query's key, which access rules bind.

A query for a person has a longer key than a program's. From a console it is
``.../as/{permission}/{console}``; with ``bus.access`` a console can use only keys with its own name and with
permissions that it may give. From a person with a certificate it is ``.../as/person/{name}``, which no other
sender can use; fleet.yaml of this edge has the person's permission. So both are true even if the sender's own
code is faulty. Programs have no permissions: their role alone decides.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query
from fleet.clock import Clock
from fleet.config.endpoints import COMMON_NAME, PERSON, PERSONS
from fleet.errors import Refused
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.permission import Permission
from fleet.runtime.rate_limited_counter import RateLimit, RateLimitedCounter

log = logging.getLogger(__name__)

A_MINUTE = 20  # refusals recorded in the history per minute


class BusSender(msgspec.Struct, frozen=True):
    """Sender that acts for a person, and that person's permission.

    ``identity`` is the common name of a console (``keys.LOCAL`` without a certificate) or of the ``person``,
    which is empty for a console: its message names the person. ``proven``: the name is trusted.
    """

    identity: str
    permission: Permission
    person: str = ""
    proven: bool = False


class BusSenders:
    """The senders on the bus of one process, by its access rules.

    ``consoles`` are trusted to name their users; ``people`` have certificates of their own. ``record`` writes
    into the history, for a robot or the edge itself.
    """

    def __init__(
        self,
        consoles: Collection[str],
        people: Mapping[str, Permission],
        record: Callable[[str, EventReport], None],
        clock: Clock,
    ) -> None:
        self._consoles, self._people = consoles, people
        self._record, self._clock = record, clock
        self._refused = RateLimitedCounter(log, clock)
        self._limit, self._lock = RateLimit(A_MINUTE), threading.Lock()

    def of(self, question: Query) -> BusSender | None:
        """Return the sender that acts for a person, None for a program; raises Refused for a bad key."""
        if not question.suffix:
            return None
        _, _, word, name = question.suffix.split("/")
        if word == PERSON and name in self._people:
            return BusSender(name, self._people[name], person=name, proven=True)
        if word == PERSON and COMMON_NAME.fullmatch(name):
            raise Refused(f"bus.access of this edge has no permission for {name}: view, operate or admin")
        if word not in PERSONS or not (name == keys.LOCAL or COMMON_NAME.fullmatch(name)):
            raise Refused(f"{question.suffix[:40]!a} names no permission and console, and no person")
        return BusSender(name, PERSONS[word], proven=name in self._consoles)

    def proven(self, question: Query) -> str | None:
        """Return the proven name of the sender; None when it is not proven.

        Empty: the name in the message is proven, as from a console with a certificate.
        """
        try:
            sender = self.of(question)
        except Refused:  # a stop with such a key is still a stop
            return None
        return sender.person if sender is not None and sender.proven else None

    def refusal(
        self, question: Query, needed: Permission, what: str, *, claimed: str = "", robot: str = ""
    ) -> str:
        """Return why the sender may not ask ``what``; empty when it may, and for programs. Any thread.

        A refusal is recorded in the history (of ``robot``, if given), with the sender's name.
        """
        try:
            sender = self.of(question)
        except Refused as error:
            self._refused.add("unknown", "refused %s: %s", what, str(error))
            return str(error)
        why = sender.permission.refusal(needed) if sender is not None else ""
        if sender is not None and why:
            name = sender.person or claimed or f"an unknown sender at {sender.identity}"
            self._log_refusal(
                Requester(Transport.BUS, name, proven=sender.proven), f"{what} refused: {why}", robot
            )
        return why

    def _log_refusal(self, sender: Requester, text: str, robot: str) -> None:
        """Write a refusal into log and history, at a limited rate."""
        self._refused.add(robot, "%s%s (%s)", f"{robot}: " if robot else "", text, sender.name)
        now = self._clock.monotonic()
        with self._lock:
            if self._limit.is_used(now):
                return
            self._limit.use(now)
        event = EventReport(self._clock.time(), EventKind.COMMAND, text, Severity.WARNING, sender)
        self._record(robot, event)
