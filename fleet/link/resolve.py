"""Name resolution without blocking the event loop."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

from fleet.errors import LinkLost
from fleet.link.base import Address


async def addresses_of(url: str, host: str, port: int, kind: int) -> list[tuple[Any, int, Address]]:
    """Return (family, protocol, address) for each address of ``host``, best first.

    Raises LinkLost, which is retried, for a name without an address: the name server may be back later.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(host, port, type=kind)
    except (socket.gaierror, UnicodeError) as error:
        raise LinkLost(f"{url}: the name {host!r} has no address now ({error})") from None
    return [(family, protocol, address) for family, _, protocol, _, address in found]
