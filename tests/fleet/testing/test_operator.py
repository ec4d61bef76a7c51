import asyncio

import pytest

from fleet.adapter import Adapter, AdapterConfig
from fleet.commands import command
from fleet.errors import Refused
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import Progress
from fleet.testing.operator import Operator


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
    made = Operator()
    made.adapter = Toy()
    return made


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
