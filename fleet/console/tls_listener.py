"""A TLS port that answers plain HTTP requests with a hint.

The first byte of a connection distinguishes them; it is peeked at and left in the socket.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import ssl
from collections.abc import Callable

from fleet.console.login_links import ConsoleError

log = logging.getLogger(__name__)

WITHIN = 5.0  # s for the first byte, for the handshake, and for the hint
FIRST_REQUEST = 10.0  # s for the first whole request
MOST_BEGINNING = 128  # connections before the end of their handshake
AGAIN = 0.2  # s after a failed accept: too many files are open
BACKLOG = 128
HANDSHAKE = 0x16  # first byte of a TLS record that begins a handshake
LONGEST = 4096  # bytes of a plain request that are read before the answer


def tls_context(cert: str, key: str) -> ssl.SSLContext:
    """Return the context of a server; raises ConsoleError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.set_alpn_protocols(["http/1.1"])
    try:
        context.load_cert_chain(cert, key, password=lambda: b"")  # never prompt on the terminal
    except (OSError, ssl.SSLError) as error:
        raise ConsoleError(f"console.tls cannot be used: {cert} with {key}: {error}") from None
    return context


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; raises ConsoleError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        opened = socket.create_server((host, port), family=family, backlog=BACKLOG)
    except OSError as error:
        raise ConsoleError(f"port {port} on {host} cannot be opened: {error.strerror or error}") from None
    opened.setblocking(False)
    return opened


class TlsListener:
    """Accepts connections on ``listener``, and passes those with TLS to new protocols.

    A connection that ``is_unused`` after FIRST_REQUEST is aborted. ``address`` is in the hint to plain
    requests.
    """

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext,
        make_protocol: Callable[[], asyncio.Protocol],
        is_unused: Callable[[asyncio.Protocol], bool],
        address: str,
    ) -> None:
        self._listener = listener
        self._context = context
        self._make_protocol = make_protocol
        self._is_unused = is_unused
        self._words = _plain_answer(address)
        self._room = asyncio.Semaphore(MOST_BEGINNING)
        self._beginning: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Accept connections until cancelled."""
        loop = asyncio.get_running_loop()
        try:
            while True:
                await self._room.acquire()
                try:
                    taken, _ = await loop.sock_accept(self._listener)
                except OSError as error:
                    self._room.release()
                    log.warning("a connection could not be taken: %s", error)
                    await asyncio.sleep(AGAIN)
                    continue
                task = asyncio.create_task(self._begin(taken), name="tls")
                self._beginning.add(task)
                task.add_done_callback(self._ended)
        finally:
            for task in self._beginning:
                task.cancel()
            await asyncio.gather(*self._beginning, return_exceptions=True)

    def _ended(self, task: asyncio.Task[None]) -> None:
        """Make room for another connection."""
        self._beginning.discard(task)
        self._room.release()

    async def _begin(self, taken: socket.socket) -> None:
        """Bring one connection through its handshake, or answer it with the hint."""
        taken.setblocking(False)
        passed_on = False
        try:
            async with asyncio.timeout(WITHIN):
                first = await _first_byte(taken)
            if first == HANDSHAKE:
                passed_on = True  # asyncio closes it in any case
                loop = asyncio.get_running_loop()
                protocol = self._make_protocol()  # uvloop returns another object from the call below
                transport, _ = await loop.connect_accepted_socket(
                    lambda: protocol, taken, ssl=self._context, ssl_handshake_timeout=WITHIN
                )
                loop.call_later(FIRST_REQUEST, self._end_unused, transport, protocol)
            elif first is not None:
                async with asyncio.timeout(WITHIN):
                    await self._answer_plain(taken)
        except (OSError, TimeoutError) as error:  # ssl.SSLError is an OSError
            log.debug("a connection could not be set up: %s", error)
        finally:
            if not passed_on:
                taken.close()

    def _end_unused(self, transport: asyncio.Transport, protocol: asyncio.Protocol) -> None:
        """Abort an unused connection; one with a WebSocket has another protocol by now."""
        if transport.get_protocol() is protocol and self._is_unused(protocol):
            transport.abort()

    async def _answer_plain(self, taken: socket.socket) -> None:
        """Answer a plain request."""
        loop = asyncio.get_running_loop()
        await loop.sock_recv(taken, LONGEST)
        await loop.sock_sendall(taken, self._words)
        with contextlib.suppress(OSError):
            taken.shutdown(socket.SHUT_WR)
        await loop.sock_recv(taken, LONGEST)  # closing with unread bytes could lose the answer


async def _first_byte(taken: socket.socket) -> int | None:
    """Wait for the first byte of a connection and leave it there; None at end of stream."""
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(taken, readable.set)
    try:
        await readable.wait()
    finally:
        loop.remove_reader(taken)
    first = taken.recv(1, socket.MSG_PEEK)
    return first[0] if first else None


def _plain_answer(address: str) -> bytes:
    """Return the answer to a plain HTTP request."""
    words = f"this port is for https; open {address}\n".encode()
    head = (
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain; charset=utf-8\r\n"
        f"Content-Length: {len(words)}\r\nConnection: close\r\nCache-Control: no-store\r\n\r\n"
    )
    return head.encode() + words
