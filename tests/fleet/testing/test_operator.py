import asyncio
from typing import Literal

import pytest

from fleet.adapter import Adapter, AdapterConfig, FrameAdapter, Until
from fleet.commands import command
from fleet.errors import Refused
from fleet.link.memory import MemoryRobot
from fleet.model.geometry import Vector3, Velocity
from fleet.model.health import Health
from fleet.model.navigation import Progress
from fleet.testing.operator import Operator
from fleet.testing.robot import running


class Toy(Adapter[AdapterConfig]):
    Config = AdapterConfig

    def __init__(self):
        self.driven = []

    async def stop(self, reason):
        """Do nothing."""

    def halt(self):
        """Do nothing."""

    def drive(self, velocity):
        self.driven.append(velocity)

    @command("beep")
    async def beep(self, *, times: int) -> int:
        return times

    @command("climb")
    async def climb(self):
        for percent in (0.0, 100.0):
            yield Progress(percent)

    @command("sleep", timeout=0.01)
    async def sleep(self):
        await asyncio.Event().wait()


@pytest.fixture
def operator():
    return Operator(Toy())


async def test_an_answer_or_the_progress_comes_back(operator):
    assert await operator.do("beep", times=3) == 3
    assert await operator.do("climb") == [0.0, 100.0]


async def test_what_the_command_does_not_take_is_refused(operator):
    with pytest.raises(Refused):
        await operator.do("beep", times="three")


async def test_a_command_has_the_time_that_it_declares(operator):
    with pytest.raises(TimeoutError):
        await operator.do("sleep")


async def test_a_velocity_is_asked_for_again_and_again(operator):
    forward = Velocity(Vector3(1.0, 0.0, 0.0))
    await operator.drive(forward, 0.3)
    assert operator.adapter.driven == [forward] * 3


class GripperConfig(AdapterConfig):
    adapter: Literal["gripper"]
    link: str


class Gripper(FrameAdapter[GripperConfig]):
    Config = GripperConfig
    state = b""

    @command("grip", moves=False, timeout=5.0)
    def grip(self):
        self.state = b""
        yield b"G\n"
        yield Until(lambda: self.state in {b"closed", b"empty"})
        if self.state == b"empty":
            raise Refused("closed on nothing")

    def hello(self):
        yield b"?\n"

    def decode(self, frame, stamp):
        self.state = frame
        yield Health()

    def halt(self):
        yield b"S\n"


async def test_a_command_of_a_frame_adapter_waits_for_what_the_robot_reports():
    states = iter([b"open\n", b"closed\n", b"empty\n"])  # the answers to the greeting and to each grip
    config = GripperConfig(
        name="one", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", adapter="gripper", link="memory:gripper"
    )
    with MemoryRobot("gripper", lambda data: b"" if data == b"S\n" else next(states)):
        async with running(Gripper, config) as (adapter, _):
            await Operator(adapter).do("grip")
            with pytest.raises(Refused, match="closed on nothing"):
                await Operator(adapter).do("grip")


async def test_a_command_that_is_not_declared_is_named_with_those_that_are(operator):
    with pytest.raises(LookupError, match="no command 'beeep'; declared: beep, climb, sleep"):
        await operator.do("beeep")
