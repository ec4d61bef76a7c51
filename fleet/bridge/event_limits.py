"""How many events of a robot the cloud is told, and where a loop through the cloud is cut.

Pure but for its memory: the clock is passed in. An event may start a workflow, whose command may lead to the
next event. So of each kind a robot tells at most ``A_MINUTE`` a minute, and no more at all of a kind to
which more than ``LOOP`` requests from the cloud have led within a minute, until that was so no longer. What
is cut is counted; the edge's own history has it. What others on the bus say in the fleet's name has limits of
its own: it takes no room from what this process's robots tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport
from fleet.runtime.rate_limited_counter import RateLimit
from fleet.spool.losses import Gap, Reason

WINDOW = 60.0  # s
OTHERWISE = 6
A_MINUTE: Mapping[EventKind, int] = MappingProxyType(
    {EventKind.EMERGENCY_STOP: 12, EventKind.AUTHORITY_LOST: 12, EventKind.FAILSAFE: 12}
)
"""Events of a kind that one robot tells within a minute; ``OTHERWISE`` of those that are not named."""
LOOP = 3
"""Requests from the cloud that may lead to events of one kind of one robot within a minute."""


_Told = tuple[str, EventKind, bool]
"""Topic, kind, and whether others said it."""


class EventLimits:
    """Those of all robots of an edge, by the topic of their events.

    ``now`` is monotonic seconds everywhere, so that a clock that is set silences nothing; ``wall`` Unix
    seconds.
    """

    def __init__(self) -> None:
        self._told: dict[_Told, RateLimit] = {}
        self._requests: dict[_Told, dict[str, float]] = {}
        self._cuts: dict[tuple[str, Reason], tuple[float, Gap]] = {}  # each with when it began

    def admits(self, topic: str, event: EventReport, now: float, wall: float, *, heard: bool = False) -> bool:
        """Return whether an event is told, and count it when it is not; ``heard``: on the bus."""
        kind = (topic, event.kind, heard)
        if self._loops(kind, event, now):
            reason = Reason.LOOP
        elif self._floods(kind, now):
            reason = Reason.RATE
        else:
            return True
        _, cut = self._cuts.setdefault((topic, reason), (now, Gap(topic, reason, 0, wall, wall)))
        cut.until, cut.lost = wall, cut.lost + 1
        return False

    def take_cuts(self, now: float) -> list[Gap]:
        """Remove and return what was cut, a minute after the first of it."""
        due = [key for key, (since, _) in list(self._cuts.items()) if now - since >= WINDOW]
        return [self._cuts.pop(key)[1] for key in due]

    def _loops(self, kind: _Told, event: EventReport, now: float) -> bool:
        """Return whether too many requests from the cloud have led to events of this kind."""
        if event.asker is None or event.asker.way is not Transport.CLOUD:
            return False
        requests = self._requests.setdefault(kind, {})
        request = event.request or event.asker.name
        requests.pop(request, None)
        requests[request] = now
        for each in list(requests):  # the oldest first; more than are needed to judge are not kept
            if now - requests[each] >= WINDOW or len(requests) > LOOP + 1:
                del requests[each]
        return len(requests) > LOOP

    def _floods(self, kind: _Told, now: float) -> bool:
        """Return whether a robot has told too many of this kind; one that may be told is counted."""
        told = self._told.setdefault(kind, RateLimit(A_MINUTE.get(kind[1], OTHERWISE)))
        if told.is_used(now):
            return True
        told.use(now)
        return False
