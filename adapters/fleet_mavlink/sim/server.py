"""Simulated vehicles of one process, each on its own socket."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import Any

from fleet.sim.server import SimServer
from fleet_mavlink.sim.spec import VehicleSpec
from fleet_mavlink.sim.vehicle import SimVehicle
from fleet_mavlink.sim.wire import MavlinkWire

_log = logging.getLogger(__name__)
_ANSWER = 0.005  # s after a message, for delayed answers
SocketAddress = tuple[str, int]


class UdpVehicle(asyncio.DatagramProtocol):
    """One vehicle on its own UDP socket; it sends to ``target``, or to the last sender."""

    def __init__(self, spec: VehicleSpec, target: SocketAddress | None) -> None:
        loop = asyncio.get_running_loop()
        self._loop = loop
        self._started = loop.time()
        self._speed = spec.speed
        self._peer = target
        self._follows = target is None
        self._stirring: asyncio.TimerHandle | None = None
        vehicle = SimVehicle(
            spec.flavour,
            vehicle=spec.vehicle,
            system_id=spec.system_id,
            home=spec.home,
            ready_after=spec.ready,
            faults=spec.faults,
            seed=spec.seed,
            epoch=time.time(),
        )
        self.wire = MavlinkWire(vehicle, spec.accessories)
        self.url = ""
        self._transport: Any = None

    def now(self) -> float:
        """Return the simulation time of this vehicle, s."""
        return (self._loop.time() - self._started) * self._speed

    def connection_made(self, transport: Any) -> None:
        """Store the transport."""
        self._transport = transport
        self.url = f"udpout:127.0.0.1:{transport.get_extra_info('sockname')[1]}"

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Process a station's datagram and answer at once."""
        if self._follows:
            self._peer = addr
        self.write(self.wire.receive(data, self.now()))
        if self._stirring is None:
            self._stirring = self._loop.call_later(_ANSWER, self._stir)

    def error_received(self, exc: Exception) -> None:
        """Ignore it: no peer listens yet, and a vehicle keeps sending."""
        _log.debug("system %s: %s", self.wire.vehicle.system_id, exc)

    def _stir(self) -> None:
        self._stirring = None
        self.step()

    def step(self) -> None:
        """Advance the vehicle and send due messages."""
        self.write(self.wire.step(self.now()))

    def fault(self, name: str, value: float | None) -> None:
        """Activate a fault, or clear it; raises ValueError."""
        self.wire.vehicle.set_fault(name, value)

    def true_state(self) -> dict[str, float]:
        """Return the true position of the vehicle, m east, north and up of its start."""
        body = self.wire.vehicle.body
        return {"x": body.east, "y": body.north, "z": body.height}

    def write(self, frames: list[bytes]) -> None:
        """Send frames, each in a datagram; they are lost while there is no peer."""
        if self._peer is None or self._transport is None:
            return
        for frame in frames:
            self._transport.sendto(frame, self._peer)

    def close(self) -> None:
        """Close the socket."""
        if self._stirring is not None:
            self._stirring.cancel()
        if self._transport is not None:
            self._transport.close()


class TcpVehicle(UdpVehicle):
    """One vehicle that waits for a TCP client; a new client replaces the old one."""

    def __init__(self, spec: VehicleSpec) -> None:
        super().__init__(spec, None)
        self._server: asyncio.Server | None = None
        self._writer: asyncio.StreamWriter | None = None

    async def listen(self, host: str, port: int) -> None:
        """Open the port; raises OSError."""
        self._server = await asyncio.start_server(self._serve, host, port)
        self.url = f"tcp:{host}:{self._server.sockets[0].getsockname()[1]}"

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one client until it disconnects."""
        if self._writer is not None:
            self._writer.close()
        self._writer = writer
        self.write(self.wire.greeting())
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(4096):
                self.write(self.wire.receive(data, self.now()))
        if self._writer is writer:
            self._writer = None
        writer.close()

    def write(self, frames: list[bytes]) -> None:
        """Write frames into the stream; without a client they are lost."""
        if self._writer is not None and frames and not self._writer.is_closing():
            self._writer.write(b"".join(frames))

    def close(self) -> None:
        """Close the client and the port."""
        if self._writer is not None:
            self._writer.close()
        if self._server is not None:
            self._server.close()


class Vehicles(SimServer[VehicleSpec, UdpVehicle]):
    """Vehicles of this process."""

    Spec = VehicleSpec

    async def make(self, spec: VehicleSpec) -> UdpVehicle:
        """Create a vehicle that waits on a UDP port of its own."""
        return await self._on_udp(spec, None, 0)

    async def add_udp(
        self, spec: VehicleSpec, target: SocketAddress | None = None, port: int = 0
    ) -> UdpVehicle:
        """Add a vehicle; without a target it waits on 127.0.0.1:``port`` (0: a free one).

        Raises OSError if the port is in use.
        """
        return self.add_robot(await self._on_udp(spec, target, port))

    async def _on_udp(self, spec: VehicleSpec, target: SocketAddress | None, port: int) -> UdpVehicle:
        """Open a vehicle's UDP socket."""
        loop = asyncio.get_running_loop()
        local = ("127.0.0.1", port) if target is None else ("0.0.0.0", 0)  # noqa: S104 - it only sends to the target
        _, station = await loop.create_datagram_endpoint(lambda: UdpVehicle(spec, target), local_addr=local)
        return station

    async def add_tcp(self, spec: VehicleSpec, port: int) -> UdpVehicle:
        """Add a vehicle that waits for a client on 127.0.0.1:``port``; raises OSError."""
        station = TcpVehicle(spec)
        await station.listen("127.0.0.1", port)
        return self.add_robot(station)
