"""From the cloud to the robots and to programs on the bus.

``arrived`` decodes messages and executes emergency stops immediately, on the loop or, while the loop is
stuck, on the thread of the fallback reader. ``take`` dispatches the messages on the loop. Commands never wait
for outbound traffic.
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
from fleet.wire.strict_json import parse_object
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

MessageHandler = Callable[[Topic, CloudMessage], None]
"""Handler of a message for the bridge itself; may raise WireError."""

_CLOUD = Transport.CLOUD  # looked up once: attribute access of an enum is slow

TIME_SLICE = 0.005  # s of dispatching before the loop runs other work
REFUSE_AFTER = 1.0  # s for the edge that holds a twin to answer first: the sender takes the first reply
MOST_REFUSALS = 1_000  # delayed refusals; beyond it the oldest are dropped
MOST_WAITING = 10_000
"""Bound of the inbox, in messages; a loop that leaves it full is stuck, and the watchdog ends the process."""
MOST_BYTES = 32 << 20
"""Bound of the inbox, in bytes."""


class InboundRoute(msgspec.Struct, frozen=True):
    """Recipient and rule of a topic; ``port`` is the robot, if the topic carries requests to one."""

    topic: Topic
    rule: InboundRule
    kind: Kind
    port: RobotPort | None = None


class InboundMessage(msgspec.Struct, frozen=True, gc=False):
    """A received message; ``requested`` is the decoded request, None if it is no request to a robot."""

    route: InboundRoute
    message: CloudMessage
    at: float
    requested: Request | None


class Downlink:
    """The cloud-to-edge half of the bridge.

    An emergency stop always passes: with our own session id in it, above the size limit, retained (once),
    while the inbox is full, and for a twin that another edge holds.

    ``books`` has the rules by UUID (of twins, environments and workflows), ``any_run`` those of workflow
    runs, whose UUIDs are not known in advance. ``own`` has the handlers of the bridge itself, by suffix.
    ``held`` maps twins that another edge holds to the name of that edge: only stops are executed for them.
    The other edge answers first; a moment later this edge also answers, with the name of the other, so that
    the sender gets an answer even if the other edge is gone.
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
        own: Mapping[str, MessageHandler],
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
        self._waiting = 0  # bytes in it, approximate: two threads count
        self._stops: dict[str, dict[str, InboundMessage]] = {}  # accepted above the bound, by twin and topic
        self._retained_stops = RetainedStops()
        self._routes: dict[str, InboundRoute] = {}  # routes of our own twins, by topic; there are few
        self.held: Mapping[str, str] = {}
        self._late_refusals: deque[tuple[float, Callable[[Reply], None], Reply]] = deque(maxlen=MOST_REFUSALS)
        self.refusals = refusals
        self.received: Counter[str] = Counter()
        self.answered: Counter[str] = Counter()
        self.latencies: dict[str, Latencies] = {port.name: Latencies() for port in ports.values()}

    def join(self, port: RobotPort, book: Rulebook) -> None:
        """Deliver new messages of a twin to its new robot; messages received before go to the old one."""
        self.latencies[port.name] = Latencies()
        self._books[port.twin] = book
        self._drop_routes(port.twin)

    def leave(self, twin: str, name: str) -> None:
        """Stop delivering messages of a twin, and drop the figures of its robot."""
        self._books.pop(twin, None)
        self._drop_routes(twin)
        self.latencies.pop(name, None)

    def _drop_routes(self, twin: str) -> None:
        """Drop the cached routes of a twin."""
        routes = self._routes.items()
        self._routes = {topic: route for topic, route in list(routes) if route.topic.twin != twin}

    def arrived(self, messages: list[CloudMessage]) -> None:
        """Decode received messages; from one thread at a time."""
        now = self._clock.monotonic()
        for message in messages:
            try:
                self._arrived(message, now)
            except Exception:  # one of the next messages may be a stop
                log.exception("a message on %.120r was lost", message.topic)

    def _arrived(self, message: CloudMessage, now: float) -> None:
        """Decode one message."""
        route = self._routes.get(message.topic)
        if route is None or (route.port is not None and route.port is not self._ports.get(route.topic.twin)):
            route = self._find(message)  # or cached by the other thread just before the robot changed
        if route is None or (message.retain and self._retained_stops.counted(message.topic, message.payload)):
            return
        requested = self._read(route, route.port, message) if route.port else None
        stops = requested is not None and requested.stops
        if stops:
            self._retained_stops.note(message.topic, message.payload)
        elif self._is_barred(message, requested):
            return
        self._put(InboundMessage(route, message, now, requested), stops=stops)

    def _put(self, one: InboundMessage, *, stops: bool) -> None:
        """Queue a message for the loop, behind all earlier ones.

        A stop is queued even above the bound, unless one of the same topic is already queued above it and no
        other message for the robot has found room since. So the excess is at most the number of topics that
        take stops.
        """
        topic, twin = one.message.topic, one.route.topic.twin
        if len(self._inbox) < MOST_WAITING and self._waiting < MOST_BYTES:
            self._stops.pop(twin, None)  # this message may start motion: the next stop counts again
        elif stops and topic not in self._stops.setdefault(twin, {}):
            self._stops[twin][topic] = one
        else:
            self.refusals.add("too many", "dropped a message on %s: the queue is full", topic)
            return
        self._inbox.append(one)
        self._waiting += len(one.message.payload)

    def dispatch(self) -> bool:
        """Dispatch received messages to their recipients, for a bounded time; on the loop.

        Return True when messages are left, for which the loop must call again. Another thread may go on
        reading, so without the bound a flood would keep the loop here and no robot would be served.
        """
        end = self._clock.monotonic() + TIME_SLICE
        while self._inbox:
            one = self._inbox.popleft()
            self._waiting = self._waiting - len(one.message.payload) if self._inbox else 0
            waiting = self._stops.get(one.route.topic.twin)
            if waiting and waiting.get(one.message.topic) is one:
                waiting.pop(one.message.topic, None)
            try:
                self._dispatch(one)
            except Exception:  # the other messages must not wait for the next read: they would be late
                log.exception("a message on %s could not be dispatched", one.message.topic)
            if self._inbox and self._clock.monotonic() > end:
                return True
        return False

    def _read(self, route: InboundRoute, port: RobotPort, message: CloudMessage) -> Request | None:
        """Have a robot decode a message; an error in one must not keep the other messages from the robots."""
        size, unread = len(message.payload), ""
        if size > route.rule.size:
            unread = f"{size} bytes are more than the {route.rule.size} that are read"
        elif message.flaw and not size:
            unread = message.flaw
        try:
            requested = message.correlation
            request = _request_id(message.response_topic, requested) if requested else ""
            waits = route.kind == "command"  # the end of a goal is reported by its status
            return port.read(
                route.kind, message.payload, transport=_CLOUD, request_id=request, waits=waits, unread=unread
            )
        except Exception:
            log.exception("%s: a message on %s could not be read", port.name, message.topic)
            refusal = Reply(route.kind, ReplyStatus.REJECTED, "it could not be read; the edge's log says why")
            return Request(lambda answer: answer(refusal))

    def _find(self, message: CloudMessage) -> InboundRoute | None:
        """Return the route of a message, None if it has no recipient here; routes of own twins are cached."""
        found = self._find_rule(message)
        if found is None:
            return None
        topic, rule = found
        kind = cast("Kind", rule.taker.value)
        route = InboundRoute(topic, rule, kind, self._ports[topic.twin] if rule.taker.is_request else None)
        if topic.twin in self._ports:
            self._routes[message.topic] = route
        return route

    def _find_rule(self, message: CloudMessage) -> tuple[Topic, InboundRule] | None:
        """Return topic and rule of a message, None if it has no recipient here."""
        topic = self._topics.parse(message.topic)
        book = None
        if topic is not None:
            book = self._books.get(topic.twin)
            if topic.suffix.startswith("workflow-run:"):
                book = self._any_run
        if topic is None or book is None:
            self.refusals.add("foreign topic", "a message on %.120r has no recipient here", message.topic)
            return None
        rule = book.inward.get(ENVIRONMENT if topic.suffix.startswith("environment:") else topic.suffix)
        if rule is None:
            self.refusals.add("no rule", "a message on %.120r has no rule", message.topic)
            return None
        return topic, rule

    def _is_barred(self, message: CloudMessage, requested: Request | None) -> bool:
        """Refuse retained, damaged and our own messages, and count them. Not called for stops."""
        if message.retain:
            # A retained message is old: its request is not meant for now.
            line = "refused a retained message on %s; clear it on the broker"
            self.refusals.add("retained", line, message.topic)
        elif message.flaw:
            self.refusals.add("damaged", "refused a message on %s: %s", message.topic, message.flaw)
        elif self._session_bytes in message.payload and self._is_ours(message.payload):
            if requested is not None:
                line = "refused a message on %s: it carries this edge's own session_id"
                self.refusals.add("own session", line, message.topic)
        else:
            return False
        return True

    def _is_ours(self, payload: bytes) -> bool:
        """Return True for a message that we sent: its own ``session_id`` is ours, not one in its content."""
        try:
            return parse_object(payload, limit=len(payload)).get("session_id") == self._session
        except WireError:
            return False

    def _dispatch(self, one: InboundMessage) -> None:
        """Dispatch one message to its recipient."""
        route = one.route
        self.received[route.kind] += 1
        if route.port and one.requested:
            self._request(one, route.port, one.requested)
        elif route.rule.taker is Recipient.RELAY:
            self._relay.forward(route.topic, route.rule, one.message)
        elif route.port is None:
            self._handle(route.topic, one.message, self._own[route.rule.suffix])

    def _request(self, one: InboundMessage, port: RobotPort, requested: Request) -> None:
        """Pass a request to its robot, or answer a moment later which edge holds its twin."""
        route, message = one.route, one.message
        senders = partial(
            self._answers.senders,
            port,
            message.response_topic,
            message.correlation,
            route.kind,
            requested.once,
        )
        answer = partial(self._answer, port, MessageReplies(senders), one.at)
        holder = self.held.get(route.topic.twin)
        if holder is None:
            requested(answer)
            return
        self.refusals.add("held elsewhere", "%s is for another edge, which holds the twin", message.topic)
        due = self._clock.monotonic() + REFUSE_AFTER
        if requested.stops:
            requested(lambda reply: self._late_refusals.append((due, answer, reply)))
            return
        why = f"edge {holder} has its twin; this edge leaves the robot to it"
        self._late_refusals.append((due, answer, Reply(route.kind, ReplyStatus.REJECTED, why)))

    def send_refusals(self) -> None:
        """Send the refusals for twins of another edge, once that edge has had time to answer; on the loop."""
        while self._late_refusals and self._late_refusals[0][0] <= self._clock.monotonic():
            _, answer, refusal = self._late_refusals.popleft()
            answer(refusal)

    def _answer(self, port: RobotPort, replies: MessageReplies, arrived: float, reply: Reply) -> None:
        """Send a reply; record the latency of the first one, the receipt."""
        if not replies.answered:
            self.answered[reply.status.value] += 1
            if latencies := self.latencies.get(port.name):  # None: the robot was removed meanwhile
                latencies.add(self._clock.monotonic() - arrived)
        replies(reply)

    def _handle(self, topic: Topic, message: CloudMessage, handle: MessageHandler) -> None:
        """Handle a message for the bridge itself."""
        try:
            handle(topic, message)
        except WireError as error:
            self.refusals.add("unreadable", "a message on %s was refused: %s", message.topic, error)


def _request_id(response_topic: str | None, correlation: bytes) -> str:
    """Return an id that is unique among all requests, from a safe alphabet.

    Correlation Data is unique for its sender only: two senders may both count from 1.
    """
    return digest((response_topic or "").encode() + b"\0" + correlation)
