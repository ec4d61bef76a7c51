"""Failed logins by name or address, and the delay of the next try; without I/O or clock."""

from __future__ import annotations

import ipaddress
from collections import OrderedDict

import msgspec

FORGET = 900.0  # s without a failure after which the count of a key restarts
MOST = 4096  # keys; a new one replaces the one with the oldest last failure


class AttemptLimit(msgspec.Struct, frozen=True):
    """``free`` failures have no delay; each further one doubles it, up to ``longest`` seconds."""

    free: int
    longest: float


BY_NAME = AttemptLimit(5, 60.0)
"""Short: otherwise anyone who knows a name could keep its owner, who may need to stop robots, locked out."""
BY_ADDRESS = AttemptLimit(10, 900.0)


class _Failures(msgspec.Struct):
    """The failures of one key; ``until`` and ``last`` are monotonic seconds."""

    count: int = 0
    until: float = float("-inf")
    last: float = float("-inf")


class Attempts:
    """Failed tries by key. ``now`` is always monotonic seconds."""

    def __init__(self, limit: AttemptLimit) -> None:
        self._limit = limit
        self._failures: OrderedDict[str, _Failures] = OrderedDict()

    def wait(self, key: str, now: float) -> float:
        """Return the seconds until a key may try again, 0 if it may."""
        found = self._failures.get(key)
        return max(0.0, found.until - now) if found is not None else 0.0

    def fail(self, key: str, now: float) -> float:
        """Record a failure; return the delay of the next try in seconds."""
        found = self._failures.pop(key, None)
        if found is None or now - found.last >= FORGET:
            found = _Failures()
        found.count += 1
        found.last = now
        beyond = found.count - self._limit.free
        wait = min(self._limit.longest, 2.0 ** min(beyond, 30)) if beyond > 0 else 0.0
        found.until = now + wait
        self._failures[key] = found
        while len(self._failures) > MOST:
            self._failures.popitem(last=False)
        return wait

    def clear(self, key: str) -> None:
        """Forget the failures of a key."""
        self._failures.pop(key, None)


def address_key(address: str) -> str:
    """Return the counting key of an address; for IPv6 its /64 network, which one computer can use alone."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return "unknown"
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((parsed, 64), strict=False))
