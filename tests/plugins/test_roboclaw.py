import asyncio
import binascii
import contextlib
import importlib.util
import struct
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import NotReady
from fleet.host.robot.adapter_factory import create_adapter
from fleet.link.memory import MemoryRobot
from fleet.model.geometry import Vector3, Velocity
from fleet.model.health import Level
from fleet.model.report import BatteryReport, PoseReport
from fleet.testing.contract import AdapterContract
from fleet.testing.robot import RecordingRobot, serve
from fleet.testing.wires import OneByteAtATime
from fleet_ugv.model import Confirmed, Feedback, Wheels

PATH = Path(__file__).parents[2] / "plugins" / "roboclaw.py"
spec = importlib.util.spec_from_file_location("roboclaw_plugin", PATH)
plugin = importlib.util.module_from_spec(spec)
sys.modules["roboclaw_plugin"] = plugin  # pydantic looks annotations up there
spec.loader.exec_module(plugin)


class TestTheContract(AdapterContract):
    adapter = plugin.Roboclaw
    config = {"adapter": "roboclaw", "link": "serial:/dev/ttyACM0?baud=115200"}

    @contextlib.asynccontextmanager
    async def robot_side(self):
        self.controller = Controller()
        with MemoryRobot("claw-contract", answer=self.controller):
            yield {"link": "memory:claw-contract"}

    def velocity(self, bench):
        left, right = (ticks / 4000 for ticks in self.controller.speeds)
        return Velocity(Vector3((left + right) / 2), (right - left) / 0.3)


class Controller:
    """A controller as its description says: it takes packets and answers them in order."""

    def __init__(self):
        self.rest, self.timeout, self.speeds, self.counters = b"", 0, (0, 0), (0, 0)

    def __call__(self, data):
        self.rest += data
        said = b""
        while len(self.rest) >= 2:
            command = self.rest[1]
            size = {14: 5, 37: 12}.get(command, 2)
            if len(self.rest) < size:
                break
            taken, self.rest = self.rest[:size], self.rest[size:]
            said += self.answer(command, taken)
        return said

    def answer(self, command, taken):
        if command in {14, 37}:
            if binascii.crc_hqx(taken, 0) != 0:
                return b""
            if command == 14:
                self.timeout = taken[2]
            else:
                self.speeds = struct.unpack(">ii", taken[2:10])
            return b"\xff"
        value = {15: bytes((self.timeout,)), 24: (118).to_bytes(2), 78: struct.pack(">ii", *self.counters)}[
            command
        ]
        return value + binascii.crc_hqx(taken + value, 0).to_bytes(2)


@pytest.fixture
def codec():
    return plugin.RoboclawCodec(ticks=1000.0, timeout=0.5)


def test_golden_bytes(codec):
    assert codec.stop == bytes.fromhex("8025 0000000000000000") + binascii.crc_hqx(
        bytes.fromhex("80250000000000000000"), 0
    ).to_bytes(2)
    assert codec.motion(Wheels(0.5, -0.25))[2:10] == struct.pack(">ii", 500, -250)
    assert codec.setup()[:3] == bytes.fromhex("800e05")
    assert codec.poll() == bytes.fromhex("8018804e")


def test_the_dead_man_is_read_back_before_it_is_believed(codec):
    controller = Controller()
    assert codec.feed(controller(codec.setup())) == [Confirmed()]
    controller.timeout = 9
    codec.feed(controller(codec._request(15)))
    assert codec.feed(controller(codec._request(15))) == []


@pytest.mark.parametrize("counters", [(1000, -500), (-1, -1), (-(2**31), 255)])
def test_counters_are_read_in_any_pieces_among_acknowledgements(codec, counters):
    controller = Controller()
    controller.counters = counters
    said = controller(codec.stop + codec.motion(Wheels(1, 1)) + codec.poll() + codec.stop)
    events = [event for piece in OneByteAtATime().carry(said) for event in codec.feed(piece)]
    assert events == [Feedback(distances=(counters[0] / 1000, counters[1] / 1000), voltage=11.8)]


@given(st.lists(st.binary(max_size=40)))
def test_after_any_garbage_the_next_questions_are_understood(pieces):
    codec, controller = plugin.RoboclawCodec(ticks=1000.0, timeout=0.5), Controller()
    for piece in pieces:
        codec.poll()
        codec.feed(piece)
    events = [event for _ in range(30) for event in codec.feed(controller(codec.poll()))]
    assert Feedback(distances=(0.0, 0.0), voltage=11.8) in events


async def test_it_drives_and_reports_over_a_link():
    robot, controller = RecordingRobot(), Controller()
    config = plugin.RoboclawConfig(
        name="claw", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", adapter="roboclaw", link="memory:claw"
    )
    with MemoryRobot("claw", answer=controller):
        adapter = create_adapter(plugin.Roboclaw, config, robot)
        run = asyncio.create_task(serve(adapter))
        await robot.until(lambda: robot.healths)
        with pytest.raises(NotReady):
            adapter.drive(Velocity(Vector3(0.5)))
        for _ in range(100):
            robot.advance(0.02)
            await asyncio.sleep(0)
        assert robot.healths[-1].level is Level.OK
        adapter.drive(Velocity(Vector3(0.5), 1.0))
        assert controller.speeds == (1400, 2600)
        assert (await robot.first(PoseReport)).position.x == 0.0
        assert (await robot.first(BatteryReport)).voltage == 11.8
        adapter.halt()
        assert controller.speeds == (0, 0)
        run.cancel()
        await asyncio.gather(run, return_exceptions=True)
