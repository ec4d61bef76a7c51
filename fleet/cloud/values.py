"""Settings, messages, states and statistics of the cloud connection, without the codec's types."""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import Literal

import msgspec

from fleet.spool.message import DeliveryOutcome

PAYLOAD_LIMIT = 32 * 1024 * 1024
"""Largest MQTT packet, in bytes, of Cyberwave's broker; also the largest that is accepted."""


class CloudMessage(msgspec.Struct, frozen=True):
    """One message from the broker.

    ``retain`` is true only for an old message that the broker stored, so a command in it is stale.
    ``response_topic`` and ``correlation`` are MQTT 5's request and response properties. ``flaw`` says what
    was wrong with the packet: such a message is only checked for a stop, and without a payload its topic
    alone decides.
    """

    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False
    response_topic: str | None = None
    correlation: bytes | None = None
    flaw: str = ""


class Will(msgspec.Struct, frozen=True):
    """The message that the broker publishes for us when the connection is lost without a DISCONNECT."""

    topic: str
    payload: bytes
    qos: int = 0


class CloudSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Address of the broker and parameters of the connection. Times are seconds, sizes are bytes.

    ``insecure`` must be true for a plain connection to another computer: the token travels in clear text.
    ``backoff`` is the first and the longest delay after a network failure, ``refused_backoff`` after a
    refusal. ``queue_messages`` and ``queue_bytes`` bound the QoS 0 messages that wait for the next write.
    """

    host: str
    port: int = 8883
    tls: bool = True
    insecure: bool = False
    ca_file: str | None = None
    username: str | None = None
    password: str | None = None
    client_id: str
    protocol: Literal[5, 311] = 5
    keepalive: int = 5
    will: Will | None = None
    connect_timeout: float = 10.0
    backoff: tuple[float, float] = (0.05, 0.6)
    refused_backoff: tuple[float, float] = (5.0, 60.0)
    queue_messages: int = 5_000
    queue_bytes: int = 8 * 1024 * 1024

    def __repr__(self) -> str:
        """Describe the connection without the password, so that no log can contain it."""
        return f"CloudSettings({self.client_id!r} at {self.host}:{self.port})"


class CloudState(enum.StrEnum):
    """State of the connection."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    DISCONNECTED = "disconnected"
    """The network failed; the next attempt is soon."""
    REFUSED = "refused"
    """The broker refused the connection; attempts are slow, and the user should read the reason."""
    CLOSED = "closed"


class QueueStats(msgspec.Struct, frozen=True):
    """Statistics of the outbound queue: waiting messages, bytes of waiting QoS 0, dropped messages."""

    messages: int = 0
    size: int = 0
    dropped: int = 0


class CloudStats:
    """Counters since the start; read from any thread, written on the loop.

    ``rtt`` is the last measured round trip to the broker in seconds, None before the first. ``outbox``
    returns the statistics of the queue.
    """

    def __init__(self) -> None:
        self.connects = 0
        self.received = 0
        self.sent = 0
        self.inflight = 0
        self.rtt: float | None = None
        self.outcomes = dict.fromkeys(DeliveryOutcome, 0)
        self.outbox: Callable[[], QueueStats] = QueueStats

    @property
    def acked(self) -> int:
        """Messages that the broker has acknowledged."""
        return self.outcomes[DeliveryOutcome.ACKED]

    @property
    def refused(self) -> int:
        """Messages that the broker has refused."""
        return self.outcomes[DeliveryOutcome.REFUSED]

    @property
    def held(self) -> int:
        """Messages that were returned to the queue, to be sent again; counted each time."""
        return self.outcomes[DeliveryOutcome.HELD]

    @property
    def queued(self) -> int:
        """Messages that wait to be sent."""
        return self.outbox().messages

    @property
    def queued_bytes(self) -> int:
        """Bytes of QoS 0 that wait to be sent."""
        return self.outbox().size

    @property
    def dropped(self) -> int:
        """Outbound messages that were lost."""
        return self.outbox().dropped
