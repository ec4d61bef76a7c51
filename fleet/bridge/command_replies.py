"""How what the cloud asked is answered: once, to who asked, and once more when a command has ended."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from fleet.clock import Clock
from fleet.cloud.values import CloudMessage
from fleet.model.command import Reply, Request, Transport
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.commands import VELOCITY_WORDS
from fleet.wire.joints import JOINT_TARGETS
from fleet.wire.replies import command_response, legacy_status
from fleet.wire.rules import Kind
from fleet.wire.topics import Topics
from fleet.wire.video import VIDEO_TYPES, video_status

STREAMED = VELOCITY_WORDS | {"motion", "joints", JOINT_TARGETS}
"""Commands that come many times a second: their success is not worth a status message each."""
SAME_REFUSAL_EVERY = 1.0  # s
LONGEST_CORRELATION = 64  # bytes of Correlation Data that a status repeats
TOLD_BY_STATUS: frozenset[Kind] = frozenset({"command", "motion", "joints"})
"""What is answered with a status on the command topic when it brings no inbox."""


Tell = Callable[[Reply], None]


class RobotPort(Protocol):
    """A robot as the bridge sees it, here or in a worker."""

    name: str
    twin: str
    source_type: str
    legacy_status: bool

    def read(
        self,
        kind: Kind,
        payload: bytes,
        *,
        way: Transport,
        request_id: str = "",
        waits: bool = False,
        unread: str = "",
    ) -> Request | None:
        """Read a message, from any thread; an emergency stop is made there and then.

        What is returned takes the message, on the loop, and answers it once, and with ``waits`` once more
        when a command that was accepted has ended; None: it asks nothing.
        ``unread``: why its payload must not be read; where stops come it is taken for one.
        """


class PublishReply(Protocol):
    """How answers are published."""

    def __call__(self, topic: str, payload: bytes, *, correlation: bytes | None = None) -> None:
        """Publish at once, QoS 1."""


class MessageReplies:
    """The answers to one message: the receipt, and of a command that was accepted its end."""

    def __init__(self, receipt: Tell, end: Tell) -> None:
        self._tell, self._end = receipt, end
        self.answered = False

    def __call__(self, reply: Reply) -> None:
        """Give an answer; the first is the receipt."""
        self.answered = True
        tell, self._tell = self._tell, self._end
        tell(reply)


class CommandReplies:
    """Makes what answers one message."""

    def __init__(
        self, topics: Topics, send: PublishReply, refusals: RateLimitedCounter, clock: Clock
    ) -> None:
        self._topics = topics
        self._send = send
        self._refusals = refusals
        self._clock = clock
        self._told: dict[tuple[str, str, str], float] = {}

    def to(self, port: RobotPort, message: CloudMessage, kind: Kind, *, once: bool = False) -> MessageReplies:
        """Return what answers a message: a response to who asked for one, else a status.

        How a command ended that was accepted before is told by a status, to all who hear of the twin. What
        came of ``start_video`` and ``stop_video`` is told on their own topics besides, where the frontend
        waits for it. ``once``: it is no part of a stream, whatever its verb is.
        """
        receipt, end = self._tellers(port, message, kind, once)
        if kind == "command":
            return MessageReplies(
                partial(self._tell_with_video, port, receipt), partial(self._tell_with_video, port, end)
            )
        return MessageReplies(receipt, end)

    def _tellers(self, port: RobotPort, message: CloudMessage, kind: Kind, once: bool) -> tuple[Tell, Tell]:  # noqa: FBT001 - by position
        """Return what tells the receipt, and the end."""
        inbox, status = message.response_topic, _no_answer
        if kind in TOLD_BY_STATUS and port.legacy_status:
            status = partial(self._tell_status, port, _text(message.correlation), once)
        if inbox is None:
            return status, status
        if not self._topics.is_own_inbox(inbox, port.twin):
            line = "%s: no reply to %.120r: it is not a reply inbox of this twin"
            self._refusals.add("foreign inbox", line, port.name, inbox)
            return _no_answer, status
        return self._responder(port, inbox, message.correlation), status

    def _tell_with_video(self, port: RobotPort, tell: Tell, reply: Reply) -> None:
        """Tell who asked and, once it is known what came of a command for video, who waits for that."""
        tell(reply)
        if reply.command in VIDEO_TYPES and (reply.done is not None or not reply.ok):
            payload = video_status(reply, stamp=self._clock.time(), source_type=port.source_type)
            self._send(self._topics.twin(port.twin, f"{reply.command}/status"), payload)

    def _responder(self, port: RobotPort, inbox: str, correlation: bytes | None) -> Tell:
        """Return what sends the one ``twin.command_response.v1``."""

        def respond(reply: Reply) -> None:
            payload = command_response(
                reply, twin=port.twin, source_type=port.source_type, stamp=self._clock.time()
            )
            self._send(inbox, payload, correlation=correlation)

        return respond

    def _tell_status(self, port: RobotPort, request: str, once: bool, reply: Reply) -> None:  # noqa: FBT001 - by position
        """Put a status message on the command topic."""
        if once or self._worth_telling(port, reply):
            payload = legacy_status(
                reply, stamp=self._clock.time(), source_type=port.source_type, request=request
            )
            self._send(self._topics.twin(port.twin, "command"), payload)

    def _worth_telling(self, port: RobotPort, reply: Reply) -> bool:
        """Return False for the success of a setpoint, and for a refusal that was told just now."""
        if reply.command not in STREAMED:
            return True
        if reply.ok:
            return False
        now = self._clock.monotonic()
        refusal = (port.name, reply.command, reply.status.value)
        if now - self._told.get(refusal, float("-inf")) < SAME_REFUSAL_EVERY:
            return False
        self._told[refusal] = now
        return True


def _text(correlation: bytes | None) -> str:
    """Return Correlation Data that is text, empty for what is not; the SDK's is 32 letters."""
    if not correlation or len(correlation) > LONGEST_CORRELATION or not correlation.isascii():
        return ""
    text = correlation.decode("ascii")
    return text if text.isprintable() else ""


def _no_answer(_reply: Reply) -> None:
    """Answer nobody."""
