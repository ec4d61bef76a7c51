"""Rate limits of the events to the cloud, and the detection of loops through the cloud.

The clock is passed in; the only state is the counters. An event may start a workflow whose command leads to
the next event. So a robot sends at most ``A_MINUTE`` events of a kind in a minute, and none of a kind to
which more than ``LOOP`` requests from the cloud have led within a minute, until that is over. Suppressed
events are counted, and remain in the history of the edge. Events that other programs on the bus publish in
the format of the fleet are limited separately, so they take nothing from the limits of the robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport
from fleet.runtime.rate_limited_counter import RateLimit
from fleet.spool.losses import Gap, Reason

WINDOW = 60.0  # s
DEFAULT_A_MINUTE = 6
A_MINUTE: Mapping[EventKind, int] = MappingProxyType(
    {EventKind.EMERGENCY_STOP: 12, EventKind.AUTHORITY_LOST: 12, EventKind.FAILSAFE: 12}
)
"""Events of a kind that one robot may send within a minute; other kinds: ``DEFAULT_A_MINUTE``."""
LOOP = 3
"""Requests from the cloud that may lead to events of one kind of one robot within a minute."""


_EventKey = tuple[str, EventKind, bool]
"""Topic, kind, and whether the event came from the bus."""


class EventLimits:
    """Limits of all robots of an edge, by the topic of their events.

    ``now`` is in monotonic seconds, so that a change of the system clock suppresses nothing; ``wall`` in Unix
    seconds.
    """

    def __init__(self) -> None:
        self._limits: dict[_EventKey, RateLimit] = {}
        self._requests: dict[_EventKey, dict[str, float]] = {}
        self._suppressed: dict[tuple[str, Reason], tuple[float, Gap]] = {}  # each with its start

    def admits(self, topic: str, event: EventReport, now: float, wall: float, *, heard: bool = False) -> bool:
        """Return whether to send an event; if not, count it. ``heard``: it came from the bus."""
        kind = (topic, event.kind, heard)
        if self._loops(kind, event, now):
            reason = Reason.LOOP
        elif self._floods(kind, now):
            reason = Reason.RATE
        else:
            return True
        _, gap = self._suppressed.setdefault((topic, reason), (now, Gap(topic, reason, 0, wall, wall)))
        gap.until, gap.lost = wall, gap.lost + 1
        return False

    def take_suppressed(self, now: float) -> list[Gap]:
        """Remove and return the counts of suppressed events, a minute after the first of each."""
        due = [key for key, (since, _) in list(self._suppressed.items()) if now - since >= WINDOW]
        return [self._suppressed.pop(key)[1] for key in due]

    def _loops(self, kind: _EventKey, event: EventReport, now: float) -> bool:
        """Return whether too many requests from the cloud have led to events of this kind."""
        if event.asker is None or event.asker.transport is not Transport.CLOUD:
            return False
        requests = self._requests.setdefault(kind, {})
        request = event.request or event.asker.name
        requests.pop(request, None)
        requests[request] = now
        for each in list(requests):  # oldest first; LOOP + 1 of them are enough to decide
            if now - requests[each] >= WINDOW or len(requests) > LOOP + 1:
                del requests[each]
        return len(requests) > LOOP

    def _floods(self, kind: _EventKey, now: float) -> bool:
        """Return whether a robot has sent too many events of this kind; if not, count this one."""
        limit = self._limits.setdefault(kind, RateLimit(A_MINUTE.get(kind[1], DEFAULT_A_MINUTE)))
        if limit.is_used(now):
            return True
        limit.use(now)
        return False
