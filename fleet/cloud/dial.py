"""TCP and TLS connections to a host through a network that may drop packets without an error."""

from __future__ import annotations

import asyncio
import errno
import itertools
import os
import socket
import ssl
from collections.abc import Callable
from typing import Any

RETRY_AFTER = 1.0
"""Seconds without an answer until one more connection attempt is made, in parallel with the earlier ones.

The kernel retransmits a lost SYN after 1, 3, 7 and 15 s, so it notices seconds late that a network is back.
Earlier attempts continue, so a slow network still has its full time.
"""


async def dial(host: str, port: int, again: float = RETRY_AFTER) -> socket.socket:
    """Return a TCP connection; raise OSError when as many attempts have failed as the host has addresses.

    The addresses of the host are tried in turn, over and over: the next one immediately when an attempt
    fails, after ``again`` seconds when there is no answer. The first open connection wins. The attempts go on
    until the call is cancelled.
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
    """Return a socket connected to an address in the form of its family; raises OSError."""
    opened = socket.socket(family, kind, protocol)
    try:
        opened.setblocking(False)
        await _finish(opened, opened.connect_ex(address))
    except BaseException:
        opened.close()
        raise
    return opened


async def _finish(opened: socket.socket, number: int) -> None:
    """Wait until a socket is connected, given the result of ``connect_ex``; raises OSError.

    uvloop's ``sock_connect`` would resolve the address again, on threads that a dead name server blocks.
    """
    if number == errno.EINPROGRESS:
        loop = asyncio.get_running_loop()
        await _wait_ready(opened, loop.add_writer, loop.remove_writer)
        number = opened.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if number:
        raise OSError(number, os.strerror(number))


async def wrap_tls(opened: socket.socket, tls: ssl.SSLContext, host: str) -> ssl.SSLSocket:
    """Wrap a socket in TLS, which then owns it; raises ssl.SSLError, OSError."""
    loop = asyncio.get_running_loop()
    secured = tls.wrap_socket(opened, server_hostname=host, do_handshake_on_connect=False)
    try:
        while True:
            try:
                secured.do_handshake()
            except ssl.SSLWantReadError:
                await _wait_ready(secured, loop.add_reader, loop.remove_reader)
            except ssl.SSLWantWriteError:
                await _wait_ready(secured, loop.add_writer, loop.remove_writer)
            else:
                return secured
    except BaseException:
        secured.close()
        raise


async def _wait_ready(
    opened: socket.socket, add: Callable[[int, Callable[[], None]], object], remove: Callable[[int], object]
) -> None:
    """Wait until a socket is readable or writable; ``add`` and ``remove`` are the methods of the loop."""
    ready, number = asyncio.Event(), opened.fileno()
    add(number, ready.set)
    try:
        await ready.wait()
    finally:
        remove(number)


def _discard(late: asyncio.Task[socket.socket]) -> None:
    """Close a connection that opened too late."""
    if not late.cancelled() and late.exception() is None:
        late.result().close()
