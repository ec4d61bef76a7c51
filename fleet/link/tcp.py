"""TCP links (client side)."""

from __future__ import annotations

import asyncio
import os
import socket
import struct

from fleet.errors import LinkLost
from fleet.link.base import Receiver
from fleet.link.resolve import addresses_of
from fleet.link.stream import StreamLink

CONNECT_TIMEOUT = 5.0  # s
_BACKLOG = 16 * 1024  # bytes, some 300 MAVLink frames
# Data not acknowledged within this time would arrive too late: the link counts as down.
_UNACKNOWLEDGED = 5000  # ms, TCP_USER_TIMEOUT
_AT_ONCE = struct.pack("ii", 1, 0)  # struct linger: on, 0 s
_KEEPALIVE = ((socket.TCP_KEEPIDLE, 5), (socket.TCP_KEEPINTVL, 2), (socket.TCP_KEEPCNT, 3))  # s, s, tries


def reset_on_close(opened: socket.socket) -> None:
    """Make the close of a socket a reset, so that no unsent bytes stay in the kernel and arrive late."""
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)


async def open_tcp(url: str, host: str, port: int, receiver: Receiver) -> StreamLink:
    """Connect within CONNECT_TIMEOUT; raises LinkLost when no address of the host answers."""
    reasons = []
    for family, protocol, address in await addresses_of(url, host, port, socket.SOCK_STREAM):
        sock = socket.socket(family, socket.SOCK_STREAM, protocol)
        try:
            await _connect(sock, address)
        except OSError as error:  # TimeoutError is one
            sock.close()
            reasons.append(os.strerror(error.errno) if error.errno else f"no answer in {CONNECT_TIMEOUT:g} s")
        except BaseException:
            sock.close()
            raise
        else:
            return _link(url, sock, receiver)
    raise LinkLost(f"{url}: {'; '.join(dict.fromkeys(reasons))}")


async def _connect(sock: socket.socket, address: tuple[str, int]) -> None:
    """Connect a socket with no send delay (TCP_NODELAY) and with detection of a dead peer."""
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNACKNOWLEDGED)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in _KEEPALIVE:
        sock.setsockopt(socket.IPPROTO_TCP, option, value)
    async with asyncio.timeout(CONNECT_TIMEOUT):
        await asyncio.get_running_loop().sock_connect(sock, address)


def _link(url: str, sock: socket.socket, receiver: Receiver) -> StreamLink:
    """Return the open link, which then owns the socket."""

    def close(throw_away: bool) -> None:  # noqa: FBT001 - called by StreamLink only
        if throw_away:
            reset_on_close(sock)
        sock.close()

    return StreamLink(url, sock.fileno(), receiver, backlog=_BACKLOG, close_descriptor=close)
