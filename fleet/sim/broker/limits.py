"""What one client may cost the broker."""

from __future__ import annotations

import msgspec


class ClientLimits(msgspec.Struct, frozen=True):
    """Bounds, in bytes, messages and seconds.

    ``packet``: the largest packet taken. ``queue`` and ``queue_bytes``: what waits for one client before it
    counts as too slow. ``receive``: QoS 1 and 2 messages under way, each way. ``subscriptions``: of a client.
    ``retained``, ``retained_bytes`` and ``sessions``: how much is kept, of all clients together.
    ``connect_timeout``: how long a client may take to say CONNECT.
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
