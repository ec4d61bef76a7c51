"""Opening a connection through a network that swallows what is sent, until it is back; and TLS on it."""

from __future__ import annotations

import asyncio
import errno
import itertools
import os
import socket
import ssl
from collections.abc import Callable
from typing import Any

AGAIN = 1.0
"""Seconds without an answer after which one more connection is tried, beside those before.

The kernel repeats what a network swallows after 1, 3, 7 and 15 s: left to it, a network that is back is found
seconds late. No try is given up for the next, so a slow network still has its time.
"""


async def dial(host: str, port: int, again: float = AGAIN) -> socket.socket:
    """Return a TCP connection; raises OSError when as many tries have failed as the host has addresses.

    Each of the host's addresses has its turn, again and again: the next at once when a try fails, after
    ``again`` seconds when nothing answers. The first that is open counts. It is tried until cancelled.
    """
    found = await asyncio.get_running_loop().getaddrinfo(host, port, type=socket.SOCK_STREAM)
    failed, tries = 0, set[asyncio.Task[socket.socket]]()
    try:
        for family, kind, protocol, _, address in itertools.cycle(found):
            tries.add(asyncio.create_task(_connect(family, kind, protocol, address)))
            done, _ = await asyncio.wait(tries, timeout=again, return_when=asyncio.FIRST_COMPLETED)
            for ended in done:
                tries.discard(ended)
                failed += ended.exception() is not None
                if ended.exception() is None or failed == len(found):
                    return ended.result()
    finally:
        for late in tries:
            late.add_done_callback(_discard)
            late.cancel()
    raise OSError(f"{host} has no address")


async def _connect(family: int, kind: int, protocol: int, address: Any) -> socket.socket:
    """Return a socket that is connected to an address, which has its family's own form; raises OSError."""
    opened = socket.socket(family, kind, protocol)
    try:
        opened.setblocking(False)
        await _finish(opened, opened.connect_ex(address))
    except BaseException:
        opened.close()
        raise
    return opened


async def _finish(opened: socket.socket, number: int) -> None:
    """Wait until a socket is connected, from what ``connect_ex`` said; raises OSError.

    uvloop's ``sock_connect`` would look the address up once more, on threads that a dead name server holds.
    """
    if number == errno.EINPROGRESS:
        loop = asyncio.get_running_loop()
        await _turn_of(opened, loop.add_writer, loop.remove_writer)
        number = opened.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if number:
        raise OSError(number, os.strerror(number))


async def secure(opened: socket.socket, tls: ssl.SSLContext, host: str) -> ssl.SSLSocket:
    """Return the socket with TLS on it, which takes it over; raises ssl.SSLError, OSError."""
    loop = asyncio.get_running_loop()
    secured = tls.wrap_socket(opened, server_hostname=host, do_handshake_on_connect=False)
    try:
        while True:
            try:
                secured.do_handshake()
            except ssl.SSLWantReadError:
                await _turn_of(secured, loop.add_reader, loop.remove_reader)
            except ssl.SSLWantWriteError:
                await _turn_of(secured, loop.add_writer, loop.remove_writer)
            else:
                return secured
    except BaseException:
        secured.close()
        raise


async def _turn_of(
    opened: socket.socket, add: Callable[[int, Callable[[], None]], object], remove: Callable[[int], object]
) -> None:
    """Wait until a socket can be read or written: ``add`` and ``remove`` are the loop's."""
    ready, number = asyncio.Event(), opened.fileno()
    add(number, ready.set)
    try:
        await ready.wait()
    finally:
        remove(number)


def _discard(late: asyncio.Task[socket.socket]) -> None:
    """Close what was opened too late."""
    if not late.cancelled() and late.exception() is None:
        late.result().close()
