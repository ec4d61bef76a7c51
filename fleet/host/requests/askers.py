"""Who asks for a person, and what that person may do: told by the key, which access rules bind to the asker.

A question for a person has more of a key than that of a program. From a console it is
``.../as/{permission}/{console}``; with ``bus.access`` a console can use only keys with its own name and with
permissions that it may give. From a person with a certificate it is ``.../as/person/{name}``, and nobody else
can use that name; fleet.yaml of this edge says what the person may do. So both hold whatever the asker's own
code does. Programs have no permissions: they may do what their role may.
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

A_MINUTE = 20  # refusals that the history has in a minute


class Asker(msgspec.Struct, frozen=True):
    """Who asks for a person, and what that may do.

    ``identity`` is the common name of a console (``keys.LOCAL`` without a certificate) or of the ``person``,
    which is empty for a console: its message names the person. ``proven``: the name is believed.
    """

    identity: str
    permission: Permission
    person: str = ""
    proven: bool = False


class Askers:
    """The askers on the bus of one process, by its access rules.

    ``consoles`` are believed when they name their persons; ``people`` have certificates of their own.
    ``record`` writes into the history, for a robot or the edge itself.
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

    def of(self, question: Query) -> Asker | None:
        """Return who asks for a person, None for a program; raises Refused where the key does not tell it."""
        if not question.suffix:
            return None
        _, _, word, name = question.suffix.split("/")
        if word == PERSON and name in self._people:
            return Asker(name, self._people[name], person=name, proven=True)
        if word == PERSON and COMMON_NAME.fullmatch(name):
            raise Refused(f"bus.access of this edge does not say what {name} may do: view, operate or admin")
        if word not in PERSONS or not (name == keys.LOCAL or COMMON_NAME.fullmatch(name)):
            raise Refused(f"{question.suffix[:40]!a} names no permission and console, and no person")
        return Asker(name, PERSONS[word], proven=name in self._consoles)

    def proven(self, question: Query) -> str | None:
        """Return the name of who asks where it is known to be true; None where it is not.

        Empty: it is known, and is the one that the message names, as of a console with a certificate.
        """
        try:
            asker = self.of(question)
        except Refused:  # a stop that comes by such a key is a stop all the same
            return None
        return asker.person if asker is not None and asker.proven else None

    def refusal(
        self, question: Query, needed: Permission, what: str, *, claimed: str = "", robot: str = ""
    ) -> str:
        """Return why somebody may not ask ``what``; empty when he may, and for programs. Any thread.

        A refusal is written into the history (of a robot, if that is asked), with the name of who asks.
        """
        try:
            asker = self.of(question)
        except Refused as error:
            self._refused.add("unknown", "refused %s: %s", what, str(error))
            return str(error)
        why = asker.permission.refusal(needed) if asker is not None else ""
        if asker is not None and why:
            name = asker.person or claimed or f"somebody at {asker.identity}"
            self._tell(Requester(Transport.BUS, name, proven=asker.proven), f"{what} refused: {why}", robot)
        return why

    def _tell(self, asker: Requester, text: str, robot: str) -> None:
        """Write a refusal into log and history, as long as there are not too many."""
        self._refused.add(robot, "%s%s (%s)", f"{robot}: " if robot else "", text, asker.name)
        now = self._clock.monotonic()
        with self._lock:
            if self._limit.is_used(now):
                return
            self._limit.use(now)
        event = EventReport(self._clock.time(), EventKind.COMMAND, text, Severity.WARNING, asker)
        self._record(robot, event)
