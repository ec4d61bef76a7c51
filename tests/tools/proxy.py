"""TCP proxy that injects network faults into connections: delays, cuts, resets, black holes.

For tests and benchmarks. It runs on its own thread and listens on loopback only.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable
from types import TracebackType
from typing import Any, Self

from fleet.link.tcp import reset_on_close
from fleet.runtime.event_loop import BackgroundLoop

PIECE = 65_536  # bytes of one read


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
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = BackgroundLoop("fleet-proxy", asyncio.new_event_loop)
        self._begun = contextlib.ExitStack()

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as begun:
            begun.enter_context(self._loop)
            self._loop.complete(self._listen())
            begun.callback(lambda: self._loop.complete(self._end()))
            self._begun = begun.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._begun.close()

    def cut(self) -> None:
        """End every connection in an orderly way, as a broker that is stopped does."""
        self._loop.call(self._end_all, _close)

    def reset(self) -> None:
        """End every connection with a reset, as a network that changes its address does."""
        self._loop.call(self._end_all, _reset)

    def _end_all(self, end: Callable[[asyncio.StreamWriter], None]) -> None:
        """End both sides of every connection."""
        for writer in list(self._writers):
            end(writer)

    async def _listen(self) -> None:
        """Begin to listen."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0, limit=PIECE)
        self.port = self._server.sockets[0].getsockname()[1]

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Carry a connection from now on."""
        task = asyncio.ensure_future(self._join(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _end(self) -> None:
        """Listen no more, end what is open and wait for it."""
        assert self._server is not None
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

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
        reset_on_close(writer.get_extra_info("socket"))
    writer.transport.abort()
