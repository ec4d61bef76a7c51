"""The console process: reads its task, joins the edges, serves the page until a signal or its parent's end.

``python -m fleet.console.program`` is started by ``fleet run``, ``fleet demo`` and ``fleet console``, which
write the task to its standard input. It binds to loopback; elsewhere only with TLS and a login.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import sys
from pathlib import Path

import msgspec

from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.console.app import make_app
from fleet.console.hub import Hub
from fleet.console.login_links import ConsoleError, LinkRequest, serve_links
from fleet.console.login_server import LoginServer
from fleet.console.request_guard import FOXGLOVE
from fleet.console.server import Server, server_config
from fleet.console.sessions import ConsoleUser, Sessions
from fleet.console.task import ConsoleTask, link_socket
from fleet.errors import FleetError
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.process.side_program import until_ended
from fleet.runtime.decoding import decode_json
from fleet.runtime.event_loop import run

log = logging.getLogger(__name__)

HOST = "127.0.0.1"


async def serve(task: ConsoleTask, directory: Path, ended: asyncio.Event) -> None:
    """Serve one console until ``ended``; raises ConsoleError if its port or socket is taken."""
    clock = SystemClock()
    sessions, hub = Sessions(clock), Hub(task, directory, clock)
    beyond = LoginServer(task.login, hub, clock) if task.login is not None else None
    listener = _listen(task)
    port = listener.getsockname()[1]

    def make_link(requested: LinkRequest) -> str:
        if requested.to == "foxglove":
            return f"ws://{HOST}:{port}{FOXGLOVE}{hub.foxglove.tokens.new()}"
        token = sessions.new_link(ConsoleUser(requested.operator, requested.permission))
        return f"http://{HOST}:{port}/#token={token}"

    server = Server(server_config(make_app(hub, sessions)))
    path = link_socket(directory, task.name)
    links = await serve_links(path, make_link)
    turning = asyncio.create_task(hub.run(), name="hub")
    serving = asyncio.create_task(server.serve(sockets=[listener]), name="server")
    working = {turning, serving}
    if beyond is not None:
        working.add(asyncio.create_task(beyond.run(), name="beyond"))
    try:
        log.info("the console serves http://%s:%d", HOST, port)
        ending = asyncio.create_task(ended.wait(), name="ended")
        await asyncio.wait({*working, ending}, return_when=asyncio.FIRST_COMPLETED)
        ending.cancel()
    finally:
        links.close()
        path.unlink(missing_ok=True)
        server.should_exit = True
        await serving
        for task_ in working:
            task_.cancel()
        outcomes = await asyncio.gather(*working, return_exceptions=True)
        listener.close()
    for outcome in outcomes:
        if isinstance(outcome, Exception):
            raise outcome


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
        log.error("the task of this console cannot be read: %s", error)  # noqa: TRY400
        return 1
    except FleetError as error:
        log.error("%s", error)  # noqa: TRY400 - one line for a person, no traceback
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
