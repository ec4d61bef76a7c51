"""The topics of a queue, and where each stands: in the ring of its class, hungry, held."""

from __future__ import annotations

from collections import deque

from fleet.spool.holds import Holds
from fleet.spool.line import OPEN, REPLY, Line, State
from fleet.spool.memory import DURABLE, Memory
from fleet.wire.rules import Traffic

LOW = 64
"""Messages of a topic in memory below which more are fetched from disk."""
LOW_IN_NEED = 8
"""The same when memory is full."""


class Lines(dict[str, Line]):
    """Lines by topic, of messages that stand in ``memory``.

    ``rings`` are those that can send, by class, in their turn; ``hungry`` those that want more from disk,
    while ``online``.
    """

    def __init__(self, memory: Memory) -> None:
        super().__init__()
        self.online = False
        self._memory = memory
        self.rings: list[deque[Line]] = [deque() for _ in DURABLE]
        self.hungry: dict[str, Line] = {}
        self.holds = Holds()

    def of(self, topic: str, traffic: Traffic) -> Line:
        """Return the line of a topic, a new one when there is none."""
        line = self.get(topic)
        if line is None:
            line = self[topic] = Line(topic, traffic)
        return line

    def stand(self, line: Line) -> None:
        """Have a line stand where it belongs: in its ring when it can send, hungry when it runs low."""
        if not line.queued and line.sendable:
            line.queued = True
            self.rings[line.traffic].append(line)
        if line.cold and self.online and len(line.memory) + len(line.back) < self._low(line):
            self.hungry[line.topic] = line
        elif self.hungry:
            self.hungry.pop(line.topic, None)

    def forget(self, line: Line) -> None:
        """Forget a line that is empty and that nobody hears, or hears only once, as an inbox for replies."""
        if (line.state is OPEN and line.traffic is not REPLY) or not line.empty:
            return  # as nearly always
        self.pop(line.topic, None)
        self.hungry.pop(line.topic, None)
        self.holds.forget(line)
        if line.queued:
            self.rings[line.traffic].remove(line)
            line.queued = False

    def _low(self, line: Line) -> int:
        """Return how many messages of a line are to stand in memory at least."""
        if line.state is State.HELD:
            return 1
        return LOW_IN_NEED if self._memory.full else LOW
