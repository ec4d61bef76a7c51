"""The server of the broker: its port, its clients, and what becomes of them when it ends."""

import asyncio
import functools

import mqtt5
import pytest

from fleet.sim.broker import server
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.server import Broker
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE

Reason = mqtt5.DisconnectReasonCode


class Client:
    """A client on a bare socket."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer

    async def connack(self):
        """Return the reason code of the answer to CONNECT."""
        head = await self.reader.readexactly(2)
        body = await self.reader.readexactly(head[1])
        return body[1]

    async def rest(self):
        """Return all that comes until the end; None if the connection is aborted."""
        try:
            return await asyncio.wait_for(self.reader.read(), DEADLINE)
        except ConnectionResetError:
            return None


class Connect:
    """Connects clients to a broker; one without a name says nothing."""

    def __init__(self):
        self.clients = []

    async def __call__(self, broker, name, **fields):
        client = Client(*await asyncio.open_connection(broker.host, broker.port))
        self.clients.append(client)
        if name is not None:
            client.writer.write(mqtt5.ConnectPacket(name, **fields).write())
            client.code = await client.connack()
        return client

    async def close(self):
        for client in self.clients:
            client.writer.close()
        await asyncio.gather(
            *(client.writer.wait_closed() for client in self.clients), return_exceptions=True
        )


@pytest.fixture
def connect():
    return Connect()


def on_plain_loop(work):
    """Run a test on a loop of asyncio itself, which the broker needs."""

    @functools.wraps(work)
    def test(connect, **more):
        async def whole():
            try:
                await work(connect, **more)
            finally:
                await connect.close()

        asyncio.run(whole())

    return test


def goodbye(reason):
    return mqtt5.DisconnectPacket(reason_code=reason).write()


async def until(holds):
    async with asyncio.timeout(DEADLINE):
        while not holds():  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.001)


@on_plain_loop
async def test_it_listens_on_a_free_port_and_knows_its_clients_by_name(connect):
    async with Broker() as broker:
        assert broker.port
        assert broker.clients == []
        for name in ("bob", "ann"):
            await connect(broker, name)
        assert broker.clients == ["ann", "bob"]


@on_plain_loop
async def test_when_it_ends_its_clients_are_told_and_its_port_is_free(connect):
    async with Broker() as broker:
        client = await connect(broker, "ann")
    assert await client.rest() == goodbye(Reason.SERVER_SHUTTING_DOWN)
    with pytest.raises(ConnectionRefusedError):
        await connect(broker, None)
    async with Broker(port=broker.port) as again:
        assert again.port == broker.port


@pytest.mark.parametrize(("reason", "said"), [(0x98, goodbye(Reason.ADMINISTRATIVE_ACTION)), (None, None)])
@on_plain_loop
async def test_all_clients_are_disconnected_with_a_word_or_without(connect, reason, said):
    async with Broker() as broker:
        clients = [await connect(broker, name) for name in ("ann", "bob")]
        broker.disconnect_all(reason)
        assert [await client.rest() or None for client in clients] == [said, said]
        await until(lambda: broker.clients == [])


@on_plain_loop
async def test_a_half_open_client_is_forgotten_alone_and_hears_nothing(connect):
    async with Broker() as broker:
        ann, bob = [await connect(broker, name) for name in ("ann", "bob")]
        broker.half_open("ann")
        broker.half_open("nobody")
        assert broker.clients == ["bob"]
        for client in (ann, bob):
            client.writer.write(mqtt5.PingReqPacket().write())
        assert await bob.reader.readexactly(2) == mqtt5.PingRespPacket().write()
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(ann.reader.readexactly(1), 0.02)


@on_plain_loop
async def test_a_client_that_falls_silent_is_disconnected_by_the_clock(connect, monkeypatch):
    monkeypatch.setattr(server, "_TICK", 0.001)
    clock = ManualClock()
    async with Broker(clock=clock, limits=ClientLimits(connect_timeout=500.0)) as broker:
        silent, ann = await connect(broker, None), await connect(broker, "ann", keep_alive=1000)
        clock.advance(600.0)
        assert await silent.rest() == b""
        assert broker.clients == ["ann"]
        clock.advance(1000.0)
        assert await ann.rest() == goodbye(Reason.KEEP_ALIVE_TIMEOUT)


@on_plain_loop
async def test_names_and_passwords_limits_and_faults_are_those_that_it_was_given(connect):
    faults = BrokerFaults()
    check = lambda name, password: (name, password) == ("ann", b"p")  # noqa: E731
    async with Broker(faults=faults, check=check, limits=ClientLimits(sessions=1)) as broker:
        assert broker.faults is faults
        codes = [
            (await connect(broker, client, username=name, password=b"p")).code
            for client, name in (("a", "eve"), ("a", "ann"), ("b", "ann"))
        ]
        faults.refuse = 0x87
        codes.append((await connect(broker, "a", username="ann", password=b"p")).code)
    assert codes == [0x86, 0, 0x97, 0x87]
