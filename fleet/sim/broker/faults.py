"""Injected faults of the broker; every field may be changed while it runs, from any thread."""

from __future__ import annotations

import msgspec


class BrokerFaults(msgspec.Struct):
    """Active faults. ``drop`` and ``duplicate`` are topic filters, ``delay`` is in seconds.

    - ``drop``: matching messages are acknowledged but not delivered.
    - ``duplicate``: they are delivered twice.
    - ``delay``: every delivery is delayed.
    - ``no_puback``: QoS 1 is delivered but not acknowledged.
    - ``refuse``: every CONNECT is answered with this reason code (0x87 is "not authorized").
    - ``freeze``: nothing is read, written or timed out, as if the broker's computer were suspended.
    """

    drop: str | None = None
    duplicate: str | None = None
    delay: float = 0.0
    no_puback: bool = False
    refuse: int | None = None
    freeze: bool = False
