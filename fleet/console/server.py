"""uvicorn for the console: common settings of its servers, without uvicorn's signal handlers."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Iterator

import uvicorn
from starlette.types import ASGIApp

from fleet.console.request_guard import LONGEST_BODY

SHUTDOWN = 1  # s for open requests to end
PING = 5.0  # s between pings of a WebSocket, and s for the page to answer
MOST_CONNECTIONS = 512  # beyond this, new connections get 503


def server_config(app: ASGIApp) -> uvicorn.Config:
    """Return the settings of a server."""
    return uvicorn.Config(
        app,
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


class Server(uvicorn.Server):
    """uvicorn's server without its signal handlers; ``begun`` is set when it serves."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.ready = asyncio.Event()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the program."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve."""
        await super().startup(sockets)
        self.ready.set()

    @staticmethod
    def is_unused(protocol: asyncio.Protocol) -> bool:
        """Return True if a connection has not sent a whole request yet."""
        return getattr(protocol, "cycle", None) is None

    def protocol(self) -> asyncio.Protocol:
        """Return a protocol for a connection that the server has not accepted itself."""
        return self.config.http_protocol_class(  # type: ignore[call-arg]
            config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )
