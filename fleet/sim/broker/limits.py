"""Resource limits of the broker."""

from __future__ import annotations

import msgspec


class ClientLimits(msgspec.Struct, frozen=True):
    """Limits, in bytes, messages and seconds.

    ``packet``: largest accepted packet. ``queue`` and ``queue_bytes``: messages that may wait for one client
    before it counts as too slow. ``receive``: QoS 1 and 2 messages in flight, each way. ``subscriptions``:
    per client. ``retained``, ``retained_bytes`` and ``sessions``: for all clients together.
    ``connect_timeout``: time within which a client must send CONNECT.
    """

    packet: int = 32 * 1024 * 1024
    queue: int = 10_000
    queue_bytes: int = 64 * 1024 * 1024
    receive: int = 100
    subscriptions: int = 1_000
    retained: int = 10_000
    retained_bytes: int = 64 * 1024 * 1024
    sessions: int = 1_000
    connect_timeout: float = 5.0
