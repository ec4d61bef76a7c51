"""One durable message on its way to the cloud, and what can become of it."""

from __future__ import annotations

import enum

import msgspec

from fleet.wire.rules import TrafficClass

OVERHEAD = 400
"""Bytes that one waiting message costs in memory besides its payload."""


class Outcome(enum.StrEnum):
    """What became of one message that was sent."""

    ACKED = "acked"
    """The broker has it, and somebody hears."""
    HELD = "held"
    """Nobody is subscribed (MQTT 5 reason 0x10), or the broker has no room: it is sent again."""
    REFUSED = "refused"
    """The broker will not take this message, or it is larger than the broker allows."""


class Outgoing(msgspec.Struct, eq=False, gc=False):
    """One message of QoS 1 or 2 on its way out.

    ``traffic`` says what goes first: REPLY before all others. ``since`` and ``deadline`` are monotonic,
    ``expires`` is Unix time; all three are given by the spool. ``again``: it was sent before. ``seq`` orders
    the messages of a spool, ``stored``: it is on disk, ``on_disk``: and nowhere else, ``gone``: nobody waits
    for it any more. Thousands may live at once, none in a cycle: the garbage collector has no need to look at
    them.
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
        """Note what it costs in memory, in bytes."""
        self.size = len(self.payload) + OVERHEAD
