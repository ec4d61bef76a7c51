"""The outbound messages of one topic, in order, and whether the topic has a subscriber.

=======  ==================================  ====================================================
state    meaning                             sends
=======  ==================================  ====================================================
PROBE    unknown since the connect or wait   one message, and waits for its acknowledgement
OPEN     the last message had a subscriber   as many as the window allows
HELD     the last message had none           nothing until the delay is over
=======  ==================================  ====================================================
"""

from __future__ import annotations

import enum
from bisect import insort
from collections import deque
from collections.abc import Mapping

from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass

NONE_AHEAD: frozenset[int] = frozenset()
"""Shared: each empty set is an object of 0.2 kB, and a robot has several topics."""


class TopicState(enum.Enum):
    """Whether the topic has a subscriber."""

    PROBE = enum.auto()
    OPEN = enum.auto()
    HELD = enum.auto()


OPEN, PROBE, REPLY = TopicState.OPEN, TopicState.PROBE, TrafficClass.REPLY
"""Aliases for the hot path: in Python 3.11, looking up a member of an enumeration takes ten times as long."""


class TopicEvent(enum.Enum):
    """Events of the topic state machine."""

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
"""Transitions; an event without an entry leaves the state unchanged."""


class TopicQueue:
    """The messages of one topic: returned ones, those in memory, and the count of those only ``on_disk``.

    The messages counted by ``on_disk`` are on disk only, or are being written there. All of them follow
    ``loaded``, the newest number ever in memory, and none is older than ``oldest_on_disk``. ``ahead`` has
    numbers above ``loaded`` that were sent before the disk could be read, so they are not counted.
    ``in_flight`` counts the unacknowledged messages. A held topic is retried at ``retry`` (monotonic s).
    """

    def __init__(self, topic: str, traffic: TrafficClass) -> None:
        self.topic = topic
        self.traffic = traffic
        self.state = TopicState.PROBE
        self.back: list[Outgoing] = []
        self.memory: deque[Outgoing] = deque()
        self.on_disk = 0
        self.loaded = 0
        self.oldest_on_disk = 0
        self.ahead = NONE_AHEAD
        self.in_flight = 0
        self.retry = 0.0
        self.unsubscribed = 0  # attempts in a row
        self.queued = False  # it is in the ring of its class

    @property
    def sendable(self) -> bool:
        """True when a message may be sent now."""
        if not (self.back or self.memory):
            return False
        return self.state is OPEN or (self.state is PROBE and not self.in_flight)

    @property
    def empty(self) -> bool:
        """True when no message of the topic is left."""
        return not (self.back or self.memory or self.on_disk or self.in_flight)

    @property
    def waiting(self) -> int:
        """The number of messages left, without those in flight."""
        return len(self.back) + len(self.memory) + self.on_disk

    @property
    def quiet(self) -> bool:
        """True for a topic that has a subscriber and no waiting messages, and is kept: the common case."""
        if self.memory or self.back or self.on_disk:
            return False
        return self.state is OPEN and self.traffic is not REPLY

    def transition(self, event: TopicEvent) -> bool:
        """Apply an event; return whether the state changed."""
        before = self.state
        self.state = _NEXT.get((before, event), before)
        return self.state is not before

    def pop(self) -> Outgoing:
        """Remove and return the next message, the oldest."""
        return self.back.pop(0) if self.back else self.memory.popleft()

    def drop_gone(self) -> None:
        """Remove gone messages from the head of the queue.

        Most lost messages are the oldest ones, so few gone messages remain behind a live one.
        """
        while self.back and self.back[0].gone:
            del self.back[0]
        while self.memory and self.memory[0].gone:
            self.memory.popleft()

    def requeue(self, message: Outgoing) -> None:
        """Insert a message that was in flight before all newer ones."""
        message.again = True
        if not self.back or self.back[-1].seq < message.seq:
            self.back.append(message)
        else:
            insort(self.back, message, key=_seq)


def _seq(message: Outgoing) -> int:
    """Return the sort key of a message."""
    return message.seq
