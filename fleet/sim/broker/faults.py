"""How the broker misbehaves on purpose; every field may be changed while it runs, from any thread."""

from __future__ import annotations

import msgspec


class BrokerFaults(msgspec.Struct):
    """The faults that are on. ``drop`` and ``duplicate`` are topic filters, ``delay`` is in seconds.

    ``drop``: what is published there is acknowledged and forgotten. ``duplicate``: it is delivered twice.
    ``delay``: every delivery waits that long. ``no_puback``: QoS 1 is delivered but not acknowledged.
    ``refuse``: the reason code with which every CONNECT is answered (0x87 is "not authorized").
    ``freeze``: nothing is read, written or timed, as if the broker's computer were stopped.
    """

    drop: str | None = None
    duplicate: str | None = None
    delay: float = 0.0
    no_puback: bool = False
    refuse: int | None = None
    freeze: bool = False
