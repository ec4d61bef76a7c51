"""A TCP proxy that does to a connection what networks do: delay it, cut it, reset it, swallow it.

For tests and benchmarks; it runs on a thread of its own and listens on loopback only.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Self

PIECE = 65_536  # bytes of one read
LINGER_NONE = struct.pack("ii", 1, 0)  # a close with this is a reset


class TcpProxy:
    """Stands between clients and ``target`` (a port of this computer) for as long as a ``with`` block lasts.

    ``delay``: seconds each way, for bytes that come from now on. ``blackhole``: nothing passes and nobody is
    told; what came meanwhile is lost, so the connections are of no more use. ``refuse``: new connections are
    reset. All may be set from any thread. ``accepted`` counts connections.
    """

    def __init__(self, target: int, *, delay: float = 0.0) -> None:
        self.target = target
        self.delay = delay
        self.blackhole = False
        self.refuse = False
        self.accepted = 0
        self.port = 0
        self._started: Future[None] = Future()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended: asyncio.Event | None = None
        self._writers: set[asyncio.StreamWriter] = set()
        self._thread = threading.Thread(target=self._run, name="fleet-proxy", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._started.result()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._ended is not None
        self._call(self._ended.set)
        self._thread.join()

    def cut(self) -> None:
        """End every connection in an orderly way, as a broker that is stopped does."""
        self._call(lambda: self._end_all(_close))

    def reset(self) -> None:
        """End every connection with a reset, as a network that changes its address does."""
        self._call(lambda: self._end_all(_reset))

    def _call(self, function: Callable[[], Any]) -> None:
        """Run a function on the proxy's thread, and wait for it."""
        assert self._loop is not None

        async def run() -> None:
            function()

        asyncio.run_coroutine_threadsafe(run(), self._loop).result()

    def _end_all(self, end: Callable[[asyncio.StreamWriter], None]) -> None:
        """End both sides of every connection."""
        for writer in list(self._writers):
            end(writer)

    def _run(self) -> None:
        """Be the proxy's thread."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        """Listen until told to stop, then end what is open and wait for it."""
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        tasks: set[asyncio.Task[None]] = set()

        def join(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.ensure_future(self._join(reader, writer))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

        server = await asyncio.start_server(join, "127.0.0.1", 0, limit=PIECE)
        self.port = server.sockets[0].getsockname()[1]
        self._started.set_result(None)
        await self._ended.wait()
        server.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _join(self, reader: asyncio.StreamReader, near: asyncio.StreamWriter) -> None:
        """Carry one connection both ways until either side ends."""
        self.accepted += 1
        if self.refuse:
            _reset(near)
            return
        try:
            answers, far = await asyncio.open_connection("127.0.0.1", self.target, limit=PIECE)
        except OSError:
            _reset(near)
            return
        for writer in (near, far):
            writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._writers |= {near, far}
        try:
            async with asyncio.TaskGroup() as both:
                both.create_task(self._pump(reader, far))
                both.create_task(self._pump(answers, near))
        finally:
            self._writers -= {near, far}
            for writer in (near, far):
                _close(writer)

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Carry one direction. What is under way is bounded by what comes in one delay."""
        loop = asyncio.get_running_loop()
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(maxsize=10_000)
        async with _beside(self._deliver(waiting, writer)):
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(PIECE):
                    if not self.blackhole:
                        await waiting.put((loop.time() + self.delay, data))
            await waiting.put((loop.time() + self.delay, b""))
            await waiting.join()

    async def _deliver(
        self, waiting: asyncio.Queue[tuple[float, bytes]], writer: asyncio.StreamWriter
    ) -> None:
        """Write what waits when its time has come; an empty piece is the end."""
        loop = asyncio.get_running_loop()
        while True:
            due, data = await waiting.get()
            await asyncio.sleep(max(0.0, due - loop.time()))
            if not data:
                _close(writer)
            elif not (self.blackhole or writer.is_closing()):
                writer.write(data)
                with contextlib.suppress(ConnectionError):
                    await writer.drain()
            waiting.task_done()


@contextlib.asynccontextmanager
async def _beside(work: Awaitable[None]) -> Any:
    """Run something for as long as the block lasts."""
    task = asyncio.ensure_future(work)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def _close(writer: asyncio.StreamWriter) -> None:
    """Close in an orderly way."""
    with contextlib.suppress(RuntimeError):
        writer.close()


def _reset(writer: asyncio.StreamWriter) -> None:
    """Close with a reset."""
    with contextlib.suppress(OSError):
        writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, LINGER_NONE)
    writer.transport.abort()
