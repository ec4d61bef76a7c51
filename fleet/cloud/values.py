"""What the cloud connection is given and what it hands out; frozen, and free of the codec's types."""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import Literal

import msgspec

from fleet.spool.message import Outcome

PAYLOAD_LIMIT = 32 * 1024 * 1024
"""The largest MQTT packet, in bytes, that Cyberwave's broker takes; also the most that is accepted."""


class CloudMessage(msgspec.Struct, frozen=True):
    """One message from the broker.

    ``retain`` is true only for an old message that the broker kept, so a command that carries it is stale.
    ``response_topic`` and ``correlation`` are MQTT 5's request and response pair. ``flaw`` says what was
    wrong with the packet of one that is only to be looked at for a stop; without a payload its topic alone
    counts.
    """

    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False
    response_topic: str | None = None
    correlation: bytes | None = None
    flaw: str = ""


class Will(msgspec.Struct, frozen=True):
    """What the broker says for us when the connection falls without a goodbye."""

    topic: str
    payload: bytes
    qos: int = 0


class CloudSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Where the broker is and how to speak to it. Times are seconds, sizes are bytes.

    ``insecure`` must be true for a plain connection to another computer: the token travels in clear text.
    ``backoff`` is the first and the longest wait after a network failure, ``refused_backoff`` after a no.
    ``queue_messages`` and ``queue_bytes`` bound the QoS 0 messages that wait for the next write.
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
        """Describe the connection without the password, so that no log can hold it."""
        return f"CloudSettings({self.client_id!r} at {self.host}:{self.port})"


class CloudState(enum.StrEnum):
    """How the connection stands."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    DISCONNECTED = "disconnected"
    """The network failed; it is tried again soon."""
    REFUSED = "refused"
    """The broker said no; it is tried again slowly, and a person should read why."""
    CLOSED = "closed"


class QueueStats(msgspec.Struct, frozen=True):
    """What the outbox tells of itself: messages that wait, bytes of those of QoS 0, messages dropped."""

    messages: int = 0
    size: int = 0
    dropped: int = 0


class CloudStats:
    """Counters since the start; read from any thread, written on the loop.

    ``rtt`` is the last measured round trip to the broker in seconds, None before the first. ``outbox``
    tells what waits when it is asked.
    """

    def __init__(self) -> None:
        self.connects = 0
        self.received = 0
        self.sent = 0
        self.inflight = 0
        self.rtt: float | None = None
        self.outcomes = dict.fromkeys(Outcome, 0)
        self.outbox: Callable[[], QueueStats] = QueueStats

    @property
    def acked(self) -> int:
        """How many messages the broker has taken."""
        return self.outcomes[Outcome.ACKED]

    @property
    def refused(self) -> int:
        """How many messages the broker has refused."""
        return self.outcomes[Outcome.REFUSED]

    @property
    def held(self) -> int:
        """How many times a message was given back, to be sent again."""
        return self.outcomes[Outcome.HELD]

    @property
    def queued(self) -> int:
        """How many messages wait to be sent."""
        return self.outbox().messages

    @property
    def queued_bytes(self) -> int:
        """How many bytes of QoS 0 wait to be sent."""
        return self.outbox().size

    @property
    def dropped(self) -> int:
        """How many messages were lost on the way out."""
        return self.outbox().dropped
