"""The simulator's vehicles, their sockets, and what is asked of them."""

import asyncio
import contextlib
import socket

import msgspec
import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.server import Vehicles
from fleet_mavlink.sim.spec import VehicleSpec


@pytest.fixture
async def server():
    made = Vehicles()
    wheel = asyncio.create_task(made.run())
    yield made
    wheel.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await wheel


async def request(server, line):
    return msgspec.json.decode(await server.answer(msgspec.json.encode(line)))


def port_of(url):
    return int(url.rpartition(":")[2])


class Listener(asyncio.DatagramProtocol):
    def __init__(self):
        self.messages = asyncio.Queue()
        self._parser = mav.MAVLink(None)

    def datagram_received(self, data, addr):
        for message in self._parser.parse_buffer(data) or ():
            self.messages.put_nowait((addr, message))


async def heard(listener, kind, *, system=1):
    async with asyncio.timeout(60):
        while True:
            _, message = await listener.messages.get()
            if message.get_type() == kind and message.get_srcSystem() == system:
                return message


async def listen(**where):
    loop = asyncio.get_running_loop()
    return await loop.create_datagram_endpoint(Listener, **where)


async def test_an_added_vehicle_waits_to_be_heard(server):
    reply = await request(server, {"add": {"flavour": "px4", "system_id": 4, "ready": 0}})
    transport, listener = await listen(remote_addr=("127.0.0.1", port_of(reply["url"])))
    transport.sendto(bytes(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mav.MAVLink(None, 255, 190))))
    assert (await heard(listener, "HEARTBEAT", system=4)).autopilot == mav.MAV_AUTOPILOT_PX4
    transport.close()


async def test_vehicles_may_share_the_port_they_speak_to(server):
    transport, listener = await listen(local_addr=("127.0.0.1", 0))
    target = transport.get_extra_info("sockname")
    for system_id in (1, 2):
        await server.add_udp(VehicleSpec("ardupilot", system_id=system_id, ready=0.0), target)
    for system_id in (1, 2):
        await heard(listener, "HEARTBEAT", system=system_id)
    transport.close()


async def test_a_vehicle_is_looked_at_spoiled_and_taken_away(server):
    url = (await request(server, {"add": {"flavour": "px4", "system_id": 4}}))["url"]
    vehicle = server.robots[url].wire.vehicle
    assert await request(server, {"look": {"url": url}}) == {"x": 0.0, "y": 0.0, "z": 0.0}
    assert await request(server, {"fault": {"url": url, "name": "loss", "value": 0.1}}) == {}
    assert vehicle.faults == {"loss": 0.1}
    await request(server, {"fault": {"url": url, "name": "loss", "value": None}})
    assert vehicle.faults == {}
    assert await request(server, {"remove": {"url": url}}) == {}
    assert server.robots == {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free_again:
        await asyncio.sleep(0)  # the loop closes what is closed in its next turn
        free_again.bind(("127.0.0.1", port_of(url)))


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b'{"add": {"flavour": "rover"}}', "Invalid enum value"),
        (b'{"add": {"flavour": "px4", "system_id": 0}}', "system id 0"),
    ],
)
async def test_a_vehicle_that_cannot_be_is_answered_with_the_reason(server, line, says):
    assert says in msgspec.json.decode(await server.answer(line))["error"]


async def test_tcp_begins_with_text_and_goes_on_with_frames(server):
    station = await server.add_tcp(VehicleSpec("ardupilot", ready=0.0), 0)
    reader, writer = await asyncio.open_connection("127.0.0.1", port_of(station.url))
    async with asyncio.timeout(60):
        assert (await reader.readexactly(18)) == b"\n\nInit ArduCopter "
        assert await reader.readuntil(b"\xfd")
    writer.close()
    await writer.wait_closed()
