"""A viewer that reads slowly: it gets newer messages instead of more of them."""

import asyncio
import json

import msgspec
import pytest

from fleet.console.foxglove.backlog import LATE
from fleet.console.foxglove.channels import Channels
from fleet.console.foxglove.viewer import TELL_EVERY, Viewer
from fleet.model.report import BatteryReport
from fleet.testing.clock import ManualClock
from fleet.wire.databus import encode_report

KEY = "cw/6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11/data/battery"


class Socket:
    """A WebSocket whose other side reads when the test says so."""

    def __init__(self):
        self.sent, self.received = [], asyncio.Queue()
        self.reads = asyncio.Event()
        self.reads.set()

    async def send_text(self, text):
        await self.reads.wait()
        self.sent.append(json.loads(text))

    async def send_bytes(self, data):
        await self.reads.wait()
        self.sent.append(msgspec.json.decode(data[13:])["percent"])

    async def receive(self):
        return await self.received.get()


@pytest.fixture
async def slow():
    """Serve a viewer that has subscribed; gives what a report of a percentage does, and its socket."""
    clock, channels, socket = ManualClock(), Channels(), Socket()
    changed = asyncio.Event()
    viewer = Viewer(socket, channels, clock, changed.set)

    async def report(percent):
        payload = encode_report(BatteryReport(1.0, percent), 1)
        viewer.offer(channels.convert("yard-1", [(KEY, payload)], round(percent), frozenset({1})))
        for _ in range(5):
            await asyncio.sleep(0)

    running = asyncio.create_task(viewer.run("x"))
    await report(0.0)
    requested = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 1}]}
    await socket.received.put({"type": "websocket.receive", "text": json.dumps(requested)})
    async with asyncio.timeout(60):
        await changed.wait()
    yield report, socket, clock
    await socket.received.put({"type": "websocket.disconnect"})
    await running


def percents(socket):
    return [each for each in socket.sent if isinstance(each, float)]


async def test_it_gets_the_newest_when_it_reads_again_and_how_much_it_missed(slow):
    report, socket, clock = slow
    await report(1.0)
    assert percents(socket) == [0.0, 1.0]
    socket.reads.clear()
    for percent in range(2, 52):
        clock.advance(2 * LATE)
        await report(float(percent))
    socket.reads.set()
    await report(52.0)
    assert percents(socket)[:3] == [0.0, 1.0, 2.0]
    assert percents(socket)[-2:] == [51.0, 52.0]
    assert len(percents(socket)) < 8
    missed = 53 - len(percents(socket))
    clock.advance(TELL_EVERY)
    await report(53.0)
    warnings = [each["message"] for each in socket.sent if isinstance(each, dict) and each["op"] == "status"]
    assert warnings == [f"{missed} older messages were left out: this viewer reads too slowly"]
