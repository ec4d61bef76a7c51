"""The console process: reads its task, joins the edges, serves the page until a signal or its parent ends it.

``python -m fleet.console.program`` is started by ``fleet run``, ``fleet demo`` and ``fleet console``, which
write the task to its standard input. It binds to loopback alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import uvicorn

from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.console.app import make_app
from fleet.console.guard import LONGEST_BODY
from fleet.console.hub import Hub
from fleet.console.links import ConsoleError, LinkAsked, serve_links
from fleet.console.sessions import Operator, Sessions
from fleet.console.task import ConsoleTask, link_socket
from fleet.errors import FleetError
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.process.side_program import until_ended
from fleet.runtime.decoding import decode_json
from fleet.runtime.event_loop import run

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
SHUTDOWN = 1  # s for open requests to end
PING = 5.0  # s between pings of a WebSocket, and s that the page has to answer
MOST_CONNECTIONS = 512  # with more, new ones are told to come again


class _Server(uvicorn.Server):
    """uvicorn's server, whose signals are ours."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the program."""
        yield


async def serve(task: ConsoleTask, directory: Path, ended: asyncio.Event) -> None:
    """Serve one console until ``ended``; raises ConsoleError when its port or socket is taken."""
    clock = SystemClock()
    sessions, hub = Sessions(clock), Hub(task, directory, clock)
    listener = _listen(task)
    port = listener.getsockname()[1]

    def make_link(asked: LinkAsked) -> str:
        token = sessions.new_link(Operator(asked.operator, asked.permission))
        return f"http://{HOST}:{port}/#token={token}"

    config = uvicorn.Config(
        make_app(hub, sessions),
        http="h11",
        ws="websockets-sansio",
        ws_max_size=LONGEST_BODY,
        ws_ping_interval=PING,
        ws_ping_timeout=PING,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        date_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=SHUTDOWN,
        limit_concurrency=MOST_CONNECTIONS,
        h11_max_incomplete_event_size=LONGEST_BODY,
    )
    server = _Server(config)
    path = link_socket(directory, task.name)
    links = await serve_links(path, make_link)
    turning = asyncio.create_task(hub.run(), name="hub")
    serving = asyncio.create_task(server.serve(sockets=[listener]), name="server")
    try:
        log.info("the console serves http://%s:%d", HOST, port)
        ending = asyncio.create_task(ended.wait(), name="ended")
        await asyncio.wait({turning, serving, ending}, return_when=asyncio.FIRST_COMPLETED)
        ending.cancel()
    finally:
        links.close()
        path.unlink(missing_ok=True)
        server.should_exit = True
        await serving
        turning.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await turning
        listener.close()


def _listen(task: ConsoleTask) -> socket.socket:
    """Return a socket that listens on loopback; raises ConsoleError."""
    try:
        return socket.create_server((HOST, task.port))
    except OSError as error:
        if task.any_port and error.errno == errno.EADDRINUSE:
            return socket.create_server((HOST, 0))
        raise ConsoleError(
            f"port {task.port} on {HOST} cannot be opened: {error.strerror or error}"
        ) from None


def main() -> int:
    """Read the task and run."""
    wanted = LogSettings.of_a_worker("console")
    start_logging(msgspec.structs.replace(wanted, level=logging.WARNING))
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
    try:
        task = decode_json(sys.stdin.buffer.read(), ConsoleTask)
        run(until_ended(task.parent, lambda ended: serve(task, runtime_dir(), ended)))
    except msgspec.DecodeError as error:
        log.error("what this console is to run cannot be read: %s", error)  # noqa: TRY400
        return 1
    except FleetError as error:
        log.error("%s", error)  # noqa: TRY400 - one line for a person, no traceback
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
