"""The messages of one topic on their way out, in their order, and whether anybody hears them.

=======  ==================================  ====================================================
state    means                               sends
=======  ==================================  ====================================================
PROBE    a new connection: nobody knows      one message, and waits for its acknowledgement
OPEN     somebody heard the last             as many as the window takes
HELD     nobody heard the last               nothing, until its wait is over
=======  ==================================  ====================================================
"""

from __future__ import annotations

import enum
from bisect import insort
from collections import deque
from collections.abc import Mapping

from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass


class TopicState(enum.Enum):
    """Whether anybody hears the topic."""

    PROBE = enum.auto()
    OPEN = enum.auto()
    HELD = enum.auto()


OPEN, PROBE, REPLY = TopicState.OPEN, TopicState.PROBE, TrafficClass.REPLY
"""For what is asked of every message: Python 3.11 takes ten times as long to look up an enumeration's."""


class TopicEvent(enum.Enum):
    """What tells of it."""

    HEARD = enum.auto()
    UNHEARD = enum.auto()
    WAITED = enum.auto()
    CONNECTED = enum.auto()


_NEXT: Mapping[tuple[TopicState, TopicEvent], TopicState] = {
    (TopicState.PROBE, TopicEvent.HEARD): TopicState.OPEN,
    (TopicState.PROBE, TopicEvent.UNHEARD): TopicState.HELD,
    (TopicState.OPEN, TopicEvent.UNHEARD): TopicState.HELD,
    (TopicState.HELD, TopicEvent.HEARD): TopicState.PROBE,
    (TopicState.HELD, TopicEvent.WAITED): TopicState.PROBE,
    (TopicState.OPEN, TopicEvent.CONNECTED): TopicState.PROBE,
    (TopicState.HELD, TopicEvent.CONNECTED): TopicState.PROBE,
}
"""The sign leaves the state as it is where nothing is said."""


class TopicQueue:
    """One topic's messages: those that came back, those in memory, and how many more are ``on_disk``.

    Cold ones are on disk alone, or on their way there; all of them follow ``loaded``, the newest ever in
    memory, and none is older than ``cold_from``. ``ahead`` are numbers beyond ``loaded`` that are not cold:
    they were sent before what waits on disk could be read. ``flying`` are under way. A held line is tried
    again at ``retry`` (monotonic s).
    """

    def __init__(self, topic: str, traffic: TrafficClass) -> None:
        self.topic = topic
        self.traffic = traffic
        self.state = TopicState.PROBE
        self.back: list[Outgoing] = []
        self.memory: deque[Outgoing] = deque()
        self.on_disk = 0
        self.loaded = 0
        self.cold_from = 0
        self.ahead: frozenset[int] = frozenset()
        self.flying = 0
        self.retry = 0.0
        self.unheard = 0  # tries in a row
        self.queued = False  # it stands in its ring

    @property
    def sendable(self) -> bool:
        """True when a message may go now."""
        if not (self.back or self.memory):
            return False
        return self.state is OPEN or (self.state is PROBE and not self.flying)

    @property
    def empty(self) -> bool:
        """True when nothing of the topic is left."""
        return not (self.back or self.memory or self.on_disk or self.flying)

    @property
    def waiting(self) -> int:
        """How many messages are left, those under way not counted."""
        return len(self.back) + len(self.memory) + self.on_disk

    @property
    def quiet(self) -> bool:
        """True when nothing of it waits, somebody hears it, and it stays known: as nearly always."""
        if self.memory or self.back or self.on_disk:
            return False
        return self.state is OPEN and self.traffic is not REPLY

    def see(self, sign: TopicEvent) -> bool:
        """Take a sign; tell whether the state changed by it."""
        before = self.state
        self.state = _NEXT.get((before, sign), before)
        return self.state is not before

    def pop(self) -> Outgoing:
        """Remove and return the next message, the oldest."""
        return self.back.pop(0) if self.back else self.memory.popleft()

    def shed(self) -> None:
        """Let go of the oldest messages, as far as nobody waits for them any more.

        It is mostly the oldest that are lost: so hardly one stays that something older keeps.
        """
        while self.back and self.back[0].gone:
            del self.back[0]
        while self.memory and self.memory[0].gone:
            self.memory.popleft()

    def give_back(self, message: Outgoing) -> None:
        """Put a message that was under way before all that are newer."""
        message.again = True
        if not self.back or self.back[-1].seq < message.seq:
            self.back.append(message)
        else:
            insort(self.back, message, key=_seq)


def _seq(message: Outgoing) -> int:
    """Return what orders messages."""
    return message.seq
