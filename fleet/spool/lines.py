"""The topics of a queue, and where each stands: in the ring of its class, hungry, held."""

from __future__ import annotations

from collections import deque

from fleet.spool.holds import Holds
from fleet.spool.line import Line, State
from fleet.spool.memory import DURABLE
from fleet.wire.rules import Traffic


class Lines(dict[str, Line]):
    """Lines by topic.

    ``rings`` are those that can send, by class, in their turn; ``hungry`` those that want more from disk.
    """

    def __init__(self) -> None:
        super().__init__()
        self.rings: list[deque[Line]] = [deque() for _ in DURABLE]
        self.hungry: dict[str, Line] = {}
        self.holds = Holds()

    def of(self, topic: str, traffic: Traffic) -> Line:
        """Return the line of a topic, a new one when there is none."""
        line = self.get(topic)
        if line is None:
            line = self[topic] = Line(topic, traffic)
        return line

    def stand(self, line: Line, low: int) -> None:
        """Have a line stand where it belongs; it is hungry with fewer than ``low`` messages in memory."""
        if not line.queued and line.sendable:
            line.queued = True
            self.rings[line.traffic].append(line)
        if len(line.memory) + len(line.back) < low:
            self.hungry[line.topic] = line
        elif self.hungry:
            self.hungry.pop(line.topic, None)

    def forget(self, line: Line) -> None:
        """Forget a line that is empty and that nobody hears, or hears only once, as an inbox for replies."""
        if not line.empty or (line.state is State.OPEN and line.traffic is not Traffic.REPLY):
            return
        self.pop(line.topic, None)
        self.hungry.pop(line.topic, None)
        self.holds.forget(line)
        if line.queued:
            self.rings[line.traffic].remove(line)
            line.queued = False
