"""From the cloud to the robots: commands, goals and setpoints, each answered once, to who asked.

``arrived`` runs on the cloud's thread: it lets an emergency stop through at once and hands the rest to the
loop in one go.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from fleet.clock import Clock
from fleet.cloud.values import Message
from fleet.model.command import Reply, Way
from fleet.wire.commands import VERBS
from fleet.wire.replies import command_response, legacy_status
from fleet.wire.topics import Topics

log = logging.getLogger(__name__)

Kind = Literal["command", "navigate", "motion", "mission"]
KINDS: Mapping[str, Kind] = {
    "command": "command",
    "navigate/command": "navigate",
    "motion/command": "motion",
    "mission/command": "mission",
}
STREAMED = frozenset(VERBS) | {
    "move",
    "motion",
    "velocity_command",
    "locomotion_velocity",
    "set_linear_velocity",
    "set_angular_velocity",
}
"""Commands that come many times a second: their success is not worth a status message each."""
SAME_REFUSAL_EVERY = 1.0  # s


class Port(Protocol):
    """A robot as the bridge sees it, here or in a worker."""

    name: str
    twin: str
    source_type: str
    legacy_status: bool

    def look_for_emergency(self, payload: bytes) -> None:
        """Stop at once when this command message is an emergency stop; from any thread."""

    def receive(
        self,
        kind: Kind,
        payload: bytes,
        *,
        way: Way,
        answer: Callable[[Reply], None],
        request_id: str = "",
    ) -> None:
        """Take a message; ``answer`` is called once, unless the message asks nothing."""


class Send(Protocol):
    """How the downlink publishes its answers."""

    def __call__(self, topic: str, payload: bytes, *, correlation: bytes | None = None) -> None:
        """Publish at once, QoS 1."""


class Downlink:
    """The cloud-to-robots half of the bridge."""

    def __init__(
        self,
        topics: Topics,
        ports: Mapping[str, Port],
        *,
        session: str,
        send: Send,
        soon: Callable[[Callable[[], None]], None],
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._ports = ports
        self._own = f'"{session}"'.encode()
        self._send = send
        self._soon = soon
        self._clock = clock
        self._refusals: dict[tuple[str, str, str], float] = {}
        self.received = 0
        self.refused = 0

    def arrived(self, messages: list[Message]) -> None:
        """Take what one read brought; on the cloud's thread."""
        wanted = []
        for message in messages:
            port = self._port_of(message)
            if port is None:
                continue
            if message.topic.endswith("/command") and not message.topic.endswith("navigate/command"):
                _look_for_emergency(port, message.payload)
            wanted.append((port, message))
        if wanted:
            self._soon(lambda: self._take(wanted))

    def _port_of(self, message: Message) -> Port | None:
        """Return whom a message is for; None for what is nobody's, ours, or not fresh."""
        topic = self._topics.parse(message.topic)
        port = self._ports.get(topic.twin) if topic is not None and topic.leaf in KINDS else None
        if port is None or self._own in message.payload:
            return None
        if message.retain:
            # The broker kept it from some earlier time: whatever it asks is not asked now.
            self.refused += 1
            log.warning("refused a retained message on %s; clear it on the broker", message.topic)
            return None
        return port

    def _take(self, messages: list[tuple[Port, Message]]) -> None:
        """Hand messages to their robots; on the loop."""
        for port, message in messages:
            self.received += 1
            topic = self._topics.parse(message.topic)
            assert topic is not None
            port.receive(
                KINDS[topic.leaf],
                message.payload,
                way=Way.CLOUD,
                answer=self._answerer(port, message, KINDS[topic.leaf]),
                request_id=message.correlation.hex() if message.correlation else "",
            )

    def _answerer(self, port: Port, message: Message, kind: Kind) -> Callable[[Reply], None]:
        """Return what answers a message: a response to who asked for one, else a legacy status."""
        inbox = message.response_topic
        if inbox is not None and not self._topics.is_own_inbox(inbox, port.twin):
            log.warning("%s: no reply to %r: it is not a reply inbox of this twin", port.name, inbox)
            return _no_answer
        if inbox is not None:
            return self._responder(port, inbox, message.correlation)
        if kind == "command" and port.legacy_status:
            return self._status_teller(port)
        return _no_answer

    def _responder(self, port: Port, inbox: str, correlation: bytes | None) -> Callable[[Reply], None]:
        """Return what sends the one ``twin.command_response.v1``."""

        def respond(reply: Reply) -> None:
            payload = command_response(
                reply, twin=port.twin, source_type=port.source_type, stamp=self._clock.time()
            )
            self._send(inbox, payload, correlation=correlation)

        return respond

    def _status_teller(self, port: Port) -> Callable[[Reply], None]:
        """Return what puts a status message on the command topic."""

        def tell(reply: Reply) -> None:
            if not self._worth_telling(port, reply):
                return
            payload = legacy_status(reply, stamp=self._clock.time(), source_type=port.source_type)
            self._send(self._topics.twin(port.twin, "command"), payload)

        return tell

    def _worth_telling(self, port: Port, reply: Reply) -> bool:
        """Return False for the success of a setpoint, and for a refusal that was told just now."""
        if reply.command not in STREAMED:
            return True
        if reply.ok:
            return False
        now = self._clock.monotonic()
        refusal = (port.name, reply.command, reply.status.value)
        if now - self._refusals.get(refusal, float("-inf")) < SAME_REFUSAL_EVERY:
            return False
        self._refusals[refusal] = now
        return True


def _look_for_emergency(port: Port, payload: bytes) -> None:
    """Let an emergency stop through; what fails in one robot must not keep the messages of all from it."""
    try:
        port.look_for_emergency(payload)
    except Exception:  # the loop stops it once more, the orderly way
        log.exception("%s: the emergency stop did not go through at once", port.name)


def _no_answer(_reply: Reply) -> None:
    """Answer nobody."""
