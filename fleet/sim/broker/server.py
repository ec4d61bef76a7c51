"""TCP server of the broker."""

from __future__ import annotations

import asyncio
from types import TracebackType
from typing import Self

import mqtt5

from fleet.clock import Clock, SystemClock
from fleet.sim.broker.broker_core import BrokerCore, Check
from fleet.sim.broker.connection import BrokerConnection
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits

_TICK = 0.1
"""Seconds between checks of timeouts."""


class Broker:
    """An MQTT broker that runs inside an ``async with`` block and listens on ``port``.

    ``check`` verifies user names and passwords; without it every client is accepted. ``tells_unheard``: a
    publication without subscribers is acknowledged with reason code 0x10 (optional in MQTT 5); otherwise
    like any other, as by a cloud that stores everything.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        faults: BrokerFaults | None = None,
        *,
        limits: ClientLimits | None = None,
        check: Check | None = None,
        clock: Clock | None = None,
        tells_unheard: bool = True,
    ) -> None:
        self.host = host
        self.port = port
        self.faults = faults or BrokerFaults()
        self._hub = BrokerCore(
            clock or SystemClock(), limits or ClientLimits(), self.faults, check, tells_unheard=tells_unheard
        )
        self._connections: set[BrokerConnection] = set()
        self._server: asyncio.Server | None = None
        self._ticking: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(
            lambda: BrokerConnection(self._hub, self._connections), self.host, self.port
        )
        self.port = self._server.sockets[0].getsockname()[1]
        self._ticking = asyncio.create_task(self._tick())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._server
        assert self._ticking
        self._ticking.cancel()
        self._server.close()
        self.disconnect_all(mqtt5.DisconnectReasonCode.SERVER_SHUTTING_DOWN)
        await asyncio.sleep(0)
        for connection in list(self._connections):
            connection.drop()
        self._hub.close()
        await self._server.wait_closed()

    @property
    def clients(self) -> list[str]:
        """Return the ids of the connected clients."""
        return sorted(self._hub.peers)

    def disconnect_all(self, reason: int | None = None) -> None:
        """End every connection: with a reason code for MQTT 5 clients, or abort it without DISCONNECT."""
        for connection in list(self._connections):
            if reason is None:
                connection.drop()
            else:
                connection.disconnect_client(mqtt5.DisconnectReasonCode(int(reason)))

    def half_open(self, client_id: str) -> None:
        """Forget a client while its socket stays open, as after a power cut on this side."""
        for connection in list(self._connections):
            if connection.client_id == client_id:
                connection.forget()

    async def _tick(self) -> None:
        """Check timeouts and the end of a freeze, periodically."""
        while True:
            for connection in list(self._connections):
                connection.watch()
            await asyncio.sleep(_TICK)
