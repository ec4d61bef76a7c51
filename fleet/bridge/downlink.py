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

from fleet.bridge.command_replies import CommandReplies, MessageReplies, PublishReply, RobotPort
from fleet.bridge.counters import Latencies
from fleet.bridge.relay import Put, Relay
from fleet.bridge.retained_stops import RetainedStops
from fleet.clock import Clock
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError
from fleet.model.command import Reply, ReplyStatus, Request, Transport
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.envelope import digest
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import ENVIRONMENT, InboundRule, Kind, Recipient
from fleet.wire.strict import parse_object
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

Handler = Callable[[Topic, CloudMessage], None]
"""What the bridge itself does with a message; may raise WireError."""

_CLOUD = Transport.CLOUD  # looked up once: that of an enumeration is slow

TURN = 0.005  # s that messages are taken before others have their turn of the loop
DENIED_AFTER = 1.0  # s that the edge which has a twin has to answer before us: who asks takes the first
MOST_DENIED = 1_000  # denials that wait for that; of more the oldest are not told
MOST_WAITING = 10_000
"""Messages that wait for a loop which does not take them, at most; the watchdog ends such a process."""
MOST_BYTES = 32 << 20
"""Bytes of them, at most."""


class InboundRoute(msgspec.Struct, frozen=True):
    """Whom a topic's messages are for, and by which rule; ``port``: the robot that is asked, if one is."""

    topic: Topic
    rule: InboundRule
    kind: Kind
    port: RobotPort | None = None


class InboundMessage(msgspec.Struct, frozen=True, gc=False):
    """A message on its way; ``asked`` is what a robot made of it, None where it asks nothing."""

    route: InboundRoute
    message: CloudMessage
    at: float
    asked: Request | None


class Downlink:
    """The cloud-to-edge half of the bridge.

    Nothing in here stands between a stop and its robot: not what it carries of ours, not its size, not that
    the broker kept it, not how much waits before it, not another edge that has the twin.

    ``books`` has the rules by uuid (of twins and of environments), ``any_run`` those of workflow runs,
    whose uuids nobody knows. ``own`` has what the bridge itself does, by suffix. ``held``: the twins that
    another edge has, by whom: nothing but a stop is obeyed for them. The other edge answers, and a moment
    later we do, who it is: if it is not there, nobody else would.
    """

    def __init__(
        self,
        topics: Topics,
        ports: Mapping[str, RobotPort],
        *,
        books: dict[str, Rulebook],
        any_run: Rulebook | None = None,
        session: str,
        send: PublishReply,
        put: Put,
        own: Mapping[str, Handler],
        refusals: RateLimitedCounter,
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._ports = ports
        self._books = books
        self._any_run = any_run
        self._session = session
        self._session_bytes = session.encode()
        self._own = own
        self._clock = clock
        self._answers = CommandReplies(topics, send, refusals, clock)
        self._relay = Relay(put, refusals, clock)
        self._inbox: deque[InboundMessage] = deque()
        self._waiting = 0  # bytes in it, about: two threads count
        self._stops: dict[str, dict[str, InboundMessage]] = {}  # beyond the bound, by twin and topic
        self._kept = RetainedStops()
        self._known: dict[str, InboundRoute] = {}  # of our own twins, by topic: there are not many
        self.held: Mapping[str, str] = {}
        self._denied: deque[tuple[float, Callable[[Reply], None], Reply]] = deque(maxlen=MOST_DENIED)
        self.refusals = refusals
        self.received: Counter[str] = Counter()
        self.answered: Counter[str] = Counter()
        self.latencies: dict[str, Latencies] = {port.name: Latencies() for port in ports.values()}

    def join(self, port: RobotPort, book: Rulebook) -> None:
        """Take what is for a twin from now on to its new robot; messages of before go where they were to."""
        self.latencies[port.name] = Latencies()
        self._books[port.twin] = book
        self._forget(port.twin)

    def leave(self, twin: str, name: str) -> None:
        """Take nothing more for a twin; the figures of its robot end."""
        self._books.pop(twin, None)
        self._forget(twin)
        self.latencies.pop(name, None)

    def _forget(self, twin: str) -> None:
        """Find the ways of a twin's topics anew."""
        known = self._known.items()
        self._known = {topic: route for topic, route in list(known) if route.topic.twin != twin}

    def arrived(self, messages: list[CloudMessage]) -> None:
        """Read what has come; from one thread at a time."""
        now = self._clock.monotonic()
        for message in messages:
            try:
                self._arrived(message, now)
            except Exception:  # there may be a stop among what follows
                log.exception("a message on %.120r was lost", message.topic)

    def _arrived(self, message: CloudMessage, now: float) -> None:
        """Read one message."""
        route = self._known.get(message.topic)
        if route is None or (route.port is not None and route.port is not self._ports.get(route.topic.twin)):
            route = self._find(message)  # also where another thread found it just before its robot changed
        if route is None or (message.retain and self._kept.counted(message.topic, message.payload)):
            return
        asked = self._read(route, route.port, message) if route.port else None
        stops = asked is not None and asked.stops
        if stops:
            self._kept.note(message.topic, message.payload)
        elif self._is_barred(message, asked):
            return
        self._put(InboundMessage(route, message, now, asked), stops=stops)

    def _put(self, one: InboundMessage, *, stops: bool) -> None:
        """Let a message wait for the loop, behind all that came before it.

        Beyond the bound a stop waits all the same, unless one of its topic does and nothing for the robot has
        found room since: so many more wait than the bound as there are topics that take stops.
        """
        topic, twin = one.message.topic, one.route.topic.twin
        if len(self._inbox) < MOST_WAITING and self._waiting < MOST_BYTES:
            self._stops.pop(twin, None)  # the next stop ends what this one may begin
        elif stops and topic not in self._stops.setdefault(twin, {}):
            self._stops[twin][topic] = one
        else:
            self.refusals.add("too many", "a message on %s finds too many before it", topic)
            return
        self._inbox.append(one)
        self._waiting += len(one.message.payload)

    def take(self) -> bool:
        """Hand what has arrived to whom it is for, as far as its turn goes; on the loop.

        Returns True when there is more, for which the loop has to come back: another thread reads on
        meanwhile, so that a flood would never end here, and no robot have its turn.
        """
        end = self._clock.monotonic() + TURN
        while self._inbox:
            if self._clock.monotonic() > end:
                return True
            one = self._inbox.popleft()
            self._waiting = self._waiting - len(one.message.payload) if self._inbox else 0
            waiting = self._stops.get(one.route.topic.twin)
            if waiting and waiting.get(one.message.topic) is one:
                waiting.pop(one.message.topic, None)
            try:
                self._hand_over(one)
            except Exception:  # what follows must not wait for the next message: it would be late
                log.exception("a message on %s could not be taken", one.message.topic)
        return False

    def _read(self, route: InboundRoute, port: RobotPort, message: CloudMessage) -> Request | None:
        """Have a robot read a message; what fails in one must not keep the others' from them."""
        size, unread = len(message.payload), ""
        if size > route.rule.size:
            unread = f"{size} bytes are more than the {route.rule.size} that are read"
        elif message.flaw and not size:
            unread = message.flaw
        try:
            asked = message.correlation
            request = _request_id(message.response_topic, asked) if asked else ""
            waits = route.kind == "command"  # how a goal ends is told by its status
            return port.read(
                route.kind, message.payload, way=_CLOUD, request_id=request, waits=waits, unread=unread
            )
        except Exception:
            log.exception("%s: a message on %s could not be read", port.name, message.topic)
            refusal = Reply(route.kind, ReplyStatus.REJECTED, "it could not be read; the edge's log says why")
            return Request(lambda answer: answer(refusal))

    def _find(self, message: CloudMessage) -> InboundRoute | None:
        """Find whom a message is for, None for what is nobody's here; a twin's topic is found once."""
        found = self._find_rule(message)
        if found is None:
            return None
        topic, rule = found
        kind = cast("Kind", rule.taker.value)
        route = InboundRoute(topic, rule, kind, self._ports[topic.twin] if rule.taker.asks else None)
        if topic.twin in self._ports:
            self._known[message.topic] = route
        return route

    def _find_rule(self, message: CloudMessage) -> tuple[Topic, InboundRule] | None:
        """Find whom a message is for and by which rule."""
        topic = self._topics.parse(message.topic)
        book = None
        if topic is not None:
            book = self._books.get(topic.twin)
            if topic.suffix.startswith("workflow-run:"):
                book = self._any_run
        if topic is None or book is None:
            self.refusals.add("foreign topic", "a message on %.120r is for nobody here", message.topic)
            return None
        rule = book.inward.get(ENVIRONMENT if topic.suffix.startswith("environment:") else topic.suffix)
        if rule is None:
            self.refusals.add("no rule", "a message on %.120r has no rule", message.topic)
            return None
        return topic, rule

    def _is_barred(self, message: CloudMessage, asked: Request | None) -> bool:
        """Return True for what only a stop gets past, and tell it: kept, damaged, or said by ourselves."""
        if message.retain:
            # The broker kept it from some earlier time: whatever it asks is not asked now.
            line = "refused a retained message on %s; clear it on the broker"
            self.refusals.add("retained", line, message.topic)
        elif message.flaw:
            self.refusals.add("damaged", "refused a message on %s: %s", message.topic, message.flaw)
        elif message.payload.find(self._session_bytes) >= 0 and self._is_ours(message.payload):
            if asked is not None:
                line = "refused a message on %s: it carries this edge's own session_id"
                self.refusals.add("own session", line, message.topic)
        else:
            return False
        return True

    def _is_ours(self, payload: bytes) -> bool:
        """Return True for a message that we sent: its own ``session_id`` is ours, whatever it carries."""
        try:
            return parse_object(payload, limit=len(payload)).get("session_id") == self._session
        except WireError:
            return False

    def _hand_over(self, one: InboundMessage) -> None:
        """Hand one message to whom it is for."""
        route = one.route
        self.received[route.kind] += 1
        if route.port and one.asked:
            self._ask(one, route.port, one.asked)
        elif route.rule.taker is Recipient.RELAY:
            self._relay.take(route.topic, route.rule, one.message)
        elif route.port is None:
            self._do(route.topic, one.message, self._own[route.rule.suffix])

    def _ask(self, one: InboundMessage, port: RobotPort, asked: Request) -> None:
        """Ask a robot, or say a moment later which edge has its twin."""
        route, message = one.route, one.message
        tell = self._answers.to(port, message, route.kind, once=asked.once)
        answer = partial(self._answer, port, tell, one.at)
        holder = self.held.get(route.topic.twin)
        if holder is None:
            asked(answer)
            return
        self.refusals.add("held elsewhere", "%s is for another edge, which has the twin", message.topic)
        due = self._clock.monotonic() + DENIED_AFTER
        if asked.stops:
            asked(lambda reply: self._denied.append((due, answer, reply)))
            return
        why = f"edge {holder} has its twin; this edge leaves the robot to it"
        self._denied.append((due, answer, Reply(route.kind, ReplyStatus.REJECTED, why)))

    def deny(self) -> None:
        """Tell who asked for twins of another edge, once that had its time to answer; on the loop."""
        while self._denied and self._denied[0][0] <= self._clock.monotonic():
            _, answer, denial = self._denied.popleft()
            answer(denial)

    def _answer(self, port: RobotPort, tell: MessageReplies, arrived: float, reply: Reply) -> None:
        """Answer, and note how long the receipt took."""
        if not tell.answered:
            self.answered[reply.status.value] += 1
            if latencies := self.latencies.get(port.name):  # of a robot that is still there
                latencies.add(self._clock.monotonic() - arrived)
        tell(reply)

    def _do(self, topic: Topic, message: CloudMessage, handle: Handler) -> None:
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
