"""Replies to requests from the cloud: one receipt for the sender, and a second reply when a command ends."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from fleet.clock import Clock
from fleet.model.command import Reply, Request, Transport
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.commands import VELOCITY_WORDS
from fleet.wire.joints import JOINT_TARGETS
from fleet.wire.replies import command_response, legacy_status
from fleet.wire.rules import Kind
from fleet.wire.topics import Topics
from fleet.wire.video import VIDEO_TYPES, video_status

STREAMED = VELOCITY_WORDS | {"motion", "joints", JOINT_TARGETS}
"""Commands that arrive many times a second: their success is not worth a status message each."""
SAME_REFUSAL_EVERY = 1.0  # s
LONGEST_CORRELATION = 64  # bytes of Correlation Data that a status echoes
ANSWERED_BY_STATUS: frozenset[Kind] = frozenset({"command", "motion", "joints"})
"""Requests without a reply inbox that are answered with a status on the command topic."""


SendReply = Callable[[Reply], None]


class RobotPort(Protocol):
    """The bridge's view of a robot, in this process or in a worker."""

    name: str
    twin: str
    source_type: str
    legacy_status: bool

    def read(
        self,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        request_id: str = "",
        waits: bool = False,
        unread: str = "",
    ) -> Request | None:
        """Decode a message, from any thread; an emergency stop is executed immediately.

        The returned request is called on the loop with the callback for replies. It replies once; with
        ``waits``, a command that was accepted replies a second time when it ends. None: the message is not a
        request. ``unread``: why the payload must not be read; on a topic that takes stops, the message then
        counts as a stop.
        """


class PublishReply(Protocol):
    """Publisher of replies."""

    def __call__(self, topic: str, payload: bytes, *, correlation: bytes | None = None) -> None:
        """Publish at once, QoS 1."""


class MessageReplies:
    """Replies to one message: the receipt, then, for an accepted command, its end.

    ``senders`` returns the senders of both. It is called for the receipt: by then the robot has been told.
    """

    def __init__(self, senders: Callable[[], tuple[SendReply, SendReply]]) -> None:
        self._senders = senders
        self._end: SendReply | None = None

    @property
    def answered(self) -> bool:
        """True once the receipt was sent."""
        return self._end is not None

    def __call__(self, reply: Reply) -> None:
        """Send a reply; the first one is the receipt."""
        if self._end is None:
            receipt, self._end = self._senders()
            receipt(reply)
        else:
            self._end(reply)


class CommandReplies:
    """Senders of the replies to messages."""

    def __init__(
        self, topics: Topics, send: PublishReply, refusals: RateLimitedCounter, clock: Clock
    ) -> None:
        self._topics = topics
        self._send = send
        self._refusals = refusals
        self._clock = clock
        self._refused_at: dict[tuple[str, str, str], float] = {}

    def senders(
        self,
        port: RobotPort,
        inbox: str | None,
        correlation: bytes | None,
        kind: Kind,
        once: bool,  # noqa: FBT001 - by position
    ) -> tuple[SendReply, SendReply]:
        """Return the senders of the receipt and of the end: to the sender's ``inbox``, or else as a status.

        The end of a command that was accepted is published as a status, for all subscribers of the twin.
        Results of ``start_video`` and ``stop_video`` are also published on topics of their own, where the
        frontend waits for them. ``once``: the message is not part of a stream, whatever its command.
        """
        receipt, end = self._plain_senders(port, inbox, correlation, kind, once)
        if kind == "command":
            return partial(self._send_with_video, port, receipt), partial(self._send_with_video, port, end)
        return receipt, end

    def _plain_senders(
        self,
        port: RobotPort,
        inbox: str | None,
        correlation: bytes | None,
        kind: Kind,
        once: bool,  # noqa: FBT001 - by position
    ) -> tuple[SendReply, SendReply]:
        """Return the senders of the receipt and of the end, without the topics of video commands."""
        status = _no_answer
        if kind in ANSWERED_BY_STATUS and port.legacy_status:
            status = partial(self._send_status, port, _text(correlation), once)
        if inbox is None:
            return status, status
        if not self._topics.is_own_inbox(inbox, port.twin):
            line = "%s: no reply to %.120r: it is not a reply inbox of this twin"
            self._refusals.add("foreign inbox", line, port.name, inbox)
            return _no_answer, status
        return self._responder(port, inbox, correlation), status

    def _send_with_video(self, port: RobotPort, send: SendReply, reply: Reply) -> None:
        """Send a reply; publish the result of a video command on the topic of that command as well."""
        send(reply)
        if reply.command in VIDEO_TYPES and (reply.done is not None or not reply.ok):
            payload = video_status(reply, stamp=self._clock.time(), source_type=port.source_type)
            self._send(self._topics.twin(port.twin, f"{reply.command}/status"), payload)

    def _responder(self, port: RobotPort, inbox: str, correlation: bytes | None) -> SendReply:
        """Return the sender of the one ``twin.command_response.v1``."""

        def respond(reply: Reply) -> None:
            payload = command_response(
                reply, twin=port.twin, source_type=port.source_type, stamp=self._clock.time()
            )
            self._send(inbox, payload, correlation=correlation)

        return respond

    def _send_status(self, port: RobotPort, request: str, once: bool, reply: Reply) -> None:  # noqa: FBT001 - by position
        """Publish a status message on the command topic."""
        if once or self._is_worth_sending(port, reply):
            payload = legacy_status(
                reply, stamp=self._clock.time(), source_type=port.source_type, request=request
            )
            self._send(self._topics.twin(port.twin, "command"), payload)

    def _is_worth_sending(self, port: RobotPort, reply: Reply) -> bool:
        """Return False for the success of a setpoint, and for a refusal that was reported a moment ago."""
        if reply.command not in STREAMED:
            return True
        if reply.ok:
            return False
        now = self._clock.monotonic()
        refusal = (port.name, reply.command, reply.status.value)
        if now - self._refused_at.get(refusal, float("-inf")) < SAME_REFUSAL_EVERY:
            return False
        self._refused_at[refusal] = now
        return True


def _text(correlation: bytes | None) -> str:
    """Return Correlation Data as text, empty if it is not printable ASCII; the SDK sends 32 letters."""
    if not correlation or len(correlation) > LONGEST_CORRELATION or not correlation.isascii():
        return ""
    text = correlation.decode("ascii")
    return text if text.isprintable() else ""


def _no_answer(_reply: Reply) -> None:
    """Send no reply."""
