"""A robot that speaks lines over a link in this process, and what a recorder has of it."""

import asyncio
import contextlib
import functools
import shutil
import tempfile
from pathlib import Path
from typing import Literal

import pytest

import fleet
from fleet.host.robot.adapter_factory import create_adapter
from fleet.link.memory import MemoryRobot
from fleet.link.tap import OPENING, FrameTap, LinkFrames
from fleet.record.messages import report_messages
from fleet.record.reading import ReadMessage
from fleet.replay.recorded_robot import recording_of
from fleet.runtime.decoding import decode_json
from fleet.testing.robot import LoopRobot, serve
from fleet.wire.databus import encode_report
from tests.tools.waiting import DEADLINE


class RoverConfig(fleet.AdapterConfig):
    """A rover on a link."""

    adapter: Literal["rover"]
    link: fleet.LinkText


class Rover(fleet.FrameAdapter[RoverConfig]):
    """Lines with a distance and a charge; the robot is asked for its charge now and then."""

    Config = RoverConfig
    limits = fleet.Limits(speed=1.0, yaw_rate=1.0)
    tick_every = 0.05

    def __init__(self, config):
        super().__init__(config)
        self.distance = 0.0

    def drive(self, velocity):
        yield b"v %.2f\n" % velocity.linear.x

    def halt(self):
        yield b"stop\n"

    def tick(self):
        yield b"charge?\n"

    def decode(self, frame, stamp):
        kind, _, value = frame.decode().partition(" ")
        if kind == "moved":
            self.distance += float(value)
            yield fleet.PoseReport(
                stamp, fleet.Vector3(self.distance, 0.0, 0.0), fleet.quaternion_from_yaw(0.0)
            )
        elif kind == "charge":
            yield fleet.BatteryReport(stamp, percent=float(value))


CONFIG = {
    "name": "rover",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "rover",
    "link": "memory:r",
}


def answers(charge, data):
    """Answer as the rover does: a charge that falls, and some way."""
    if data != b"charge?\n":
        return b""
    charge.append(charge[-1] - 1)
    return b"charge %d\nmoved 0.1\n" % charge[-1]


async def lived(turns=20):
    """Run a rover for a while with a recorder; return the messages that this has of it."""
    robot = LoopRobot("rover")
    tap = FrameTap(robot.clock)
    tap.switch(on=True)
    OPENING.set(functools.partial(tap.open, "rover", redaction=Rover.redaction))
    adapter = create_adapter(Rover, RoverConfig.model_validate(CONFIG), robot)
    with MemoryRobot("r", functools.partial(answers, [100])):
        serving = asyncio.create_task(serve(adapter))
        async with asyncio.timeout(DEADLINE):
            await robot.until(lambda: len(robot.reports) >= turns)
        robot.close()
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
    return messages_of(tap, robot.reports)


def messages_of(tap, reports):
    """Return what a recorder makes of frames and reports."""
    put = []
    list(tap.flushing(put.append))
    stamp = decode_json(put[0], LinkFrames).stamp
    found = [ReadMessage("/yard/rover/frames", "fleet.LinkFrames", stamp, stamp, each) for each in put]
    for report in reports:
        made = report_messages("/yard/rover", report.channel, encode_report(report, 1))
        found += [ReadMessage(one.topic, one.schema, report.stamp, report.stamp, one.payload) for one in made]
    return found


@pytest.fixture
def directory():
    """Make a folder whose path is short enough for sockets."""
    path = Path(tempfile.mkdtemp(prefix="fr"))
    yield path
    shutil.rmtree(path)


@pytest.fixture
def opened():
    """Close what the test opened, the newest first."""
    with contextlib.ExitStack() as stack:

        def opened(thing):
            stack.callback(thing.close)
            return thing

        yield opened


@pytest.fixture(scope="module")
def rover_messages():
    """Record a rover once."""
    return asyncio.run(lived())


@pytest.fixture
def recorded_rover(rover_messages):
    return recording_of(rover_messages).robot("yard", "rover")


@pytest.fixture
def rover():
    return Rover


@pytest.fixture
def rover_config():
    return RoverConfig.model_validate(CONFIG)
