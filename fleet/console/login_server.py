"""The console beyond loopback: a separate port with TLS, on which people log in."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
from pathlib import Path

from fleet.clock import Clock
from fleet.config.certificates import read_identity
from fleet.console.app import make_login_app
from fleet.console.hub import Hub
from fleet.console.login import Login
from fleet.console.login_history import LoginHistory
from fleet.console.login_links import ConsoleError
from fleet.console.people import People
from fleet.console.request_guard import AllowedHosts
from fleet.console.server import Server, server_config
from fleet.console.task import LoginTask
from fleet.console.tls_listener import TlsListener, listen, tls_context

log = logging.getLogger(__name__)


class LoginServer:
    """The second server of a console, at ``base``. Opens its port at once; raises ConsoleError."""

    def __init__(self, task: LoginTask, hub: Hub, clock: Clock) -> None:
        self._people = People(Path(task.people))
        self._history = LoginHistory(task.history, clock)
        context = tls_context(task.cert, task.key)
        names = task.hosts or _names_in(Path(task.cert))
        served = AllowedHosts(
            frozenset(_as_host(name) for name in names), f"this console is at {', '.join(names)}"
        )
        self._listener = listen(task.host, task.port)
        self.base = f"https://{_as_host(names[0])}:{self._listener.getsockname()[1]}"
        login = Login(self._people, self._history, clock)
        self._server = Server(server_config(make_login_app(hub, login, served)))
        self._tls = TlsListener(self._listener, context, self._protocol, Server.is_unused, f"{self.base}/")

    async def run(self) -> None:
        """Serve until cancelled."""
        if self._people.is_empty():
            log.warning(
                "no login is possible at %s: %s",
                self.base,
                self._people.problem or "fleet console people add NAME",
            )
        serving = asyncio.create_task(self._server.serve(sockets=[]), name="login server")
        try:
            await self._server.ready.wait()
            log.info("the console serves %s", self.base)
            async with asyncio.TaskGroup() as group:
                group.create_task(self._history.run(), name="login history")
                group.create_task(self._tls.run(), name="tls listener")
        finally:
            self._server.should_exit = True
            self._listener.close()
            with contextlib.suppress(asyncio.CancelledError):
                await serving

    def _protocol(self) -> asyncio.Protocol:
        """Return the protocol for one connection."""
        return self._server.protocol()


def _names_in(cert: Path) -> tuple[str, ...]:
    """Return the host names and addresses of a certificate; raises ConsoleError."""
    try:
        names = tuple(name for name in read_identity(cert.read_bytes()).hosts if "*" not in name)
    except (OSError, ValueError) as error:
        raise ConsoleError(f"{cert} cannot be read: {error}") from None
    if not names:
        raise ConsoleError(f"{cert} names no host: console.hosts must say how the console is reached")
    return names


def _as_host(name: str) -> str:
    """Return a name or address in URL notation."""
    try:
        parsed = ipaddress.ip_address(name)
    except ValueError:
        return name.lower()
    return f"[{parsed}]" if parsed.version == 6 else str(parsed)
