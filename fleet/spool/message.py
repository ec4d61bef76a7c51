"""A durable message for the cloud, and the possible outcomes of sending it."""

from __future__ import annotations

import enum

import msgspec

from fleet.wire.rules import TrafficClass

OVERHEAD = 400
"""Memory of a waiting message besides its payload, in bytes."""


class DeliveryOutcome(enum.StrEnum):
    """Outcome of a message that was sent."""

    ACKED = "acked"
    """The broker has it, and the topic has a subscriber."""
    HELD = "held"
    """No subscriber (MQTT 5 reason 0x10), or a quota of the broker is used up: the message is sent again."""
    REFUSED = "refused"
    """The broker refuses this message, or it is larger than the broker allows."""


class Outgoing(msgspec.Struct, eq=False, gc=False):
    """One outbound message of QoS 1 or 2.

    ``traffic`` decides the order: REPLY before all others. ``since`` and ``deadline`` are monotonic,
    ``expires`` is Unix time; the spool sets all three. ``again``: it was sent before. ``seq`` orders the
    messages of a spool. ``stored``: it is on disk. ``on_disk``: it is, or will be, on disk only. ``gone``: it
    is acknowledged or lost, and only waits for its removal from a queue. Thousands may exist at once, never
    in a reference cycle, so the garbage collector does not track them.
    """

    topic: str
    payload: bytes
    qos: int
    traffic: TrafficClass = TrafficClass.EVENT
    expiry: float | None = None
    correlation: bytes | None = None
    content_type: str | None = None
    since: float = 0.0
    deadline: float | None = None
    expires: float = 0.0
    again: bool = False
    seq: int = 0
    stored: bool = False
    on_disk: bool = False
    gone: bool = False
    size: int = 0

    def __post_init__(self) -> None:
        """Compute its cost in memory, bytes."""
        self.size = len(self.payload) + OVERHEAD
