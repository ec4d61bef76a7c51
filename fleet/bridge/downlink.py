"""From the cloud to the robots and to programs on the bus.

``arrived`` runs on the cloud's thread: it lets an emergency stop through at once and hands the rest to the
loop in one go. Commands wait for nothing that goes outward.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import cast

from fleet.bridge.answers import Answers, Port, Send
from fleet.bridge.counters import Latencies
from fleet.bridge.relay import Put, Relay
from fleet.clock import Clock
from fleet.cloud.values import Message
from fleet.errors import WireError
from fleet.model.command import Reply, ReplyStatus, Way
from fleet.tally import Tally
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import ENVIRONMENT, Inward, Kind, Taker
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

Handler = Callable[[Topic, Message], None]
"""What the bridge itself does with a message; may raise WireError."""


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
        soon: Callable[[Callable[[], None]], None],
        refusals: Tally,
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._ports = ports
        self._books = books
        self._any_run = any_run
        self._session = f'"{session}"'.encode()
        self._own = own
        self._soon = soon
        self._clock = clock
        self._answers = Answers(topics, send, refusals, clock)
        self._relay = Relay(put, refusals, clock)
        self.held: frozenset[str] = frozenset()
        self.refusals = refusals
        self.received: Counter[str] = Counter()
        self.answered: Counter[str] = Counter()
        self.latencies: dict[str, Latencies] = {port.name: Latencies() for port in ports.values()}

    def arrived(self, messages: list[Message]) -> None:
        """Take what one read brought; on the cloud's thread."""
        now = self._clock.monotonic()
        wanted = []
        for message in messages:
            found = self._rule_of(message)
            if found is None or not self._fresh(message):
                continue
            topic, rule = found
            if rule.taker is Taker.COMMAND:
                _look_for_emergency(self._ports[topic.twin], message.payload)
            wanted.append((topic, rule, message))
        if wanted:
            self._soon(lambda: self._take(wanted, now))

    def _rule_of(self, message: Message) -> tuple[Topic, Inward] | None:
        """Return whom a message is for and by which rule; None for what is nobody's here."""
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
        if self._session in message.payload:
            return False
        if message.retain:
            # The broker kept it from some earlier time: whatever it asks is not asked now.
            line = "refused a retained message on %s; clear it on the broker"
            self.refusals.add("retained", line, message.topic)
        return not message.retain

    def _take(self, messages: list[tuple[Topic, Inward, Message]], arrived: float) -> None:
        """Hand messages to whom they are for; on the loop."""
        for topic, rule, message in messages:
            self.received[rule.taker.value] += 1
            if rule.taker.asks:
                self._ask(topic, rule, message, arrived)
            elif rule.taker is Taker.RELAY:
                self._relay.take(topic, rule, message)
            else:
                self._do(topic, message, self._own[rule.leaf])

    def _ask(self, topic: Topic, rule: Inward, message: Message, arrived: float) -> None:
        """Ask a robot; what is larger than its rule is refused, and answered like anything else."""
        if topic.twin in self.held:
            self.refusals.add("held elsewhere", "%s is for another edge, which has the twin", message.topic)
            return
        port = self._ports[topic.twin]
        kind = cast("Kind", rule.taker.value)
        answer = partial(self._answer, port, self._answers.to(port, message, kind), arrived)
        if len(message.payload) > rule.size:
            reason = f"{len(message.payload)} bytes are more than the {rule.size} that are read"
            self.refusals.add("too large", "%s: %s", message.topic, reason)
            answer(Reply(kind, ReplyStatus.REJECTED, reason))
            return
        port.receive(
            kind,
            message.payload,
            way=Way.CLOUD,
            answer=answer,
            request_id=message.correlation.hex() if message.correlation else "",
        )

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


def _look_for_emergency(port: Port, payload: bytes) -> None:
    """Let an emergency stop through; what fails in one robot must not keep the messages of all from it."""
    try:
        port.look_for_emergency(payload)
    except Exception:  # the loop stops it once more, the orderly way
        log.exception("%s: the emergency stop did not go through at once", port.name)
