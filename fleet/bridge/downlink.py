"""From the cloud to the robots and to programs on the bus.

``arrived`` reads the messages, and makes an emergency stop there and then: on the loop, or on another thread
while that is stuck. ``take`` obeys, on the loop. Commands wait for nothing that goes outward.
"""

from __future__ import annotations

import logging
from collections import Counter, deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import cast

import msgspec

from fleet.bridge.answers import Answers, Port, Send, Take
from fleet.bridge.counters import Latencies
from fleet.bridge.relay import Put, Relay
from fleet.clock import Clock
from fleet.cloud.values import Message
from fleet.errors import WireError
from fleet.model.command import Reply, ReplyStatus, Way
from fleet.tally import Tally
from fleet.wire.envelope import digest
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import ENVIRONMENT, Inward, Kind, Taker
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

Handler = Callable[[Topic, Message], None]
"""What the bridge itself does with a message; may raise WireError."""

_CLOUD = Way.CLOUD  # looked up once: that of an enumeration is slow

MOST_WAITING = 10_000
"""Messages that wait for a loop which does not take them, at most; the watchdog ends such a process."""


class Route(msgspec.Struct, frozen=True):
    """Whom a topic's messages are for, and by which rule; ``port``: the robot that is asked, if one is."""

    topic: Topic
    rule: Inward
    kind: Kind
    port: Port | None = None


class Arrived(msgspec.Struct, frozen=True, gc=False):
    """A message on its way; ``take`` is what a robot made of it, None where it asks nothing."""

    route: Route
    message: Message
    at: float
    take: Take | None


class Downlink:
    """The cloud-to-edge half of the bridge.

    ``books`` has the rules by uuid (of twins and of environments), ``any_run`` those of workflow runs,
    whose uuids nobody knows. ``own`` has what the bridge itself does, by leaf. ``held`` holds the twins that
    another edge has: nothing but an emergency stop is obeyed for them, and the other edge answers.
    """

    def __init__(
        self,
        topics: Topics,
        ports: Mapping[str, Port],
        *,
        books: Mapping[str, Rulebook],
        any_run: Rulebook | None = None,
        session: str,
        send: Send,
        put: Put,
        own: Mapping[str, Handler],
        refusals: Tally,
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._ports = ports
        self._books = books
        self._any_run = any_run
        self._session = f'"{session}"'.encode()
        self._own = own
        self._clock = clock
        self._answers = Answers(topics, send, refusals, clock)
        self._relay = Relay(put, refusals, clock)
        self._inbox: deque[Arrived] = deque()
        self._known: dict[str, Route] = {}  # of our own twins, by topic: there are not many
        self.held: frozenset[str] = frozenset()
        self.refusals = refusals
        self.received: Counter[str] = Counter()
        self.answered: Counter[str] = Counter()
        self.latencies: dict[str, Latencies] = {port.name: Latencies() for port in ports.values()}

    def arrived(self, messages: list[Message]) -> None:
        """Read what has come; from one thread at a time."""
        now = self._clock.monotonic()
        for message in messages:
            route = self._known.get(message.topic) or self._find(message)
            if route is None or not self._fresh(message):
                continue
            take = self._read(route, route.port, message) if route.port else None
            if len(self._inbox) < MOST_WAITING:
                self._inbox.append(Arrived(route, message, now, take))
            else:
                self.refusals.add("too many", "a message on %s finds too many before it", message.topic)

    def take(self) -> None:
        """Hand what has arrived to whom it is for; on the loop."""
        while self._inbox:
            one = self._inbox.popleft()
            try:
                self._hand_over(one)
            except Exception:  # what follows must not wait for the next message: it would be late
                log.exception("a message on %s could not be taken", one.message.topic)

    def _read(self, route: Route, port: Port, message: Message) -> Take | None:
        """Have a robot read a message; what fails in one must not keep the others' from them."""
        try:
            asked = message.correlation
            request = _request_id(message.response_topic, asked) if asked else ""
            return port.read(route.kind, message.payload, way=_CLOUD, request_id=request)
        except Exception:
            log.exception("%s: a message on %s could not be read", port.name, message.topic)
            refusal = Reply(route.kind, ReplyStatus.REJECTED, "it could not be read; the edge's log says why")
            return lambda answer: answer(refusal)

    def _find(self, message: Message) -> Route | None:
        """Find whom a message is for, None for what is nobody's here; a twin's topic is found once."""
        found = self._find_rule(message)
        if found is None:
            return None
        topic, rule = found
        kind = cast("Kind", rule.taker.value)
        route = Route(topic, rule, kind, self._ports[topic.twin] if rule.taker.asks else None)
        if topic.twin in self._ports:
            self._known[message.topic] = route
        return route

    def _find_rule(self, message: Message) -> tuple[Topic, Inward] | None:
        """Find whom a message is for and by which rule."""
        topic = self._topics.parse(message.topic)
        book = None
        if topic is not None:
            book = self._books.get(topic.twin)
            if topic.leaf.startswith("workflow-run:"):
                book = self._any_run
        if topic is None or book is None:
            self.refusals.add("foreign topic", "a message on %.120r is for nobody here", message.topic)
            return None
        rule = book.inward.get(ENVIRONMENT if topic.leaf.startswith("environment:") else topic.leaf)
        if rule is None:
            self.refusals.add("no rule", "a message on %.120r has no rule", message.topic)
            return None
        return topic, rule

    def _fresh(self, message: Message) -> bool:
        """Return False for what we said ourselves, and for what the broker kept."""
        if message.payload.find(self._session) >= 0:  # ``in`` takes longer: it tries a number first
            return False
        if message.retain:
            # The broker kept it from some earlier time: whatever it asks is not asked now.
            line = "refused a retained message on %s; clear it on the broker"
            self.refusals.add("retained", line, message.topic)
        return not message.retain

    def _hand_over(self, one: Arrived) -> None:
        """Hand one message to whom it is for."""
        route = one.route
        self.received[route.kind] += 1
        if route.port and one.take:
            self._ask(one, route.port, one.take)
        elif route.rule.taker is Taker.RELAY:
            self._relay.take(route.topic, route.rule, one.message)
        elif route.port is None:
            self._do(route.topic, one.message, self._own[route.rule.leaf])

    def _ask(self, one: Arrived, port: Port, take: Take) -> None:
        """Ask a robot; what is larger than its rule is refused, and answered like anything else."""
        route, message = one.route, one.message
        if route.topic.twin in self.held:
            self.refusals.add("held elsewhere", "%s is for another edge, which has the twin", message.topic)
            return
        answer = partial(self._answer, port, self._answers.to(port, message, route.kind), one.at)
        if len(message.payload) > route.rule.size:
            reason = f"{len(message.payload)} bytes are more than the {route.rule.size} that are read"
            self.refusals.add("too large", "%s: %s", message.topic, reason)
            answer(Reply(route.kind, ReplyStatus.REJECTED, reason))
            return
        take(answer)

    def _answer(self, port: Port, tell: Callable[[Reply], None], arrived: float, reply: Reply) -> None:
        """Answer, and note how long it took."""
        self.answered[reply.status.value] += 1
        self.latencies[port.name].add(self._clock.monotonic() - arrived)
        tell(reply)

    def _do(self, topic: Topic, message: Message, handle: Handler) -> None:
        """Do what the bridge itself does with a message."""
        try:
            handle(topic, message)
        except WireError as error:
            self.refusals.add("unreadable", "a message on %s was refused: %s", message.topic, error)


def _request_id(response_topic: str | None, correlation: bytes) -> str:
    """Return what tells a request from all others, of short and harmless letters.

    Correlation Data means something to who sent it alone: two may well count from 1.
    """
    return digest((response_topic or "").encode() + b"\0" + correlation)
