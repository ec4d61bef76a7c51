import asyncio
import contextlib

import pytest

from fleet.clock import SystemClock
from fleet.testing.robot import RecordingRobot, serve
from fleet_quadruped import QuadrupedAdapter, QuadrupedConfig
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.sim.rig import Rig


def speaking(dog, protocol, profile="damiao-8006"):
    """Return the same dog with other drives."""
    drive = dog.drive.model_copy(update={"protocol": protocol, "profile": profile})
    return dog.model_copy(update={"drive": drive})


@pytest.fixture(scope="session")
def dog():
    return load_description(EXAMPLE)


@pytest.fixture(params=["cia402", "mit"])
def any_dog(dog, request):
    """Return the example dog with each kind of drives."""
    return speaking(dog, request.param)


@pytest.fixture(scope="session")
def mit_dog(dog):
    return speaking(dog, "mit")


@pytest.fixture
def stopped_alone():
    """Return what tells whether all drives have stopped by themselves: held (CiA 402), or limp (Damiao)."""

    def judge(rig):
        if rig.dog.drive.protocol == "mit":
            return all(motor.kp == 0 for motor in rig.sim.world.motors)
        held = all(motor.kp > 0 for motor in rig.sim.world.motors)
        return held and {drive.state for drive in rig.sim.drives} == {DriveState.QUICK_STOP}

    return judge


@pytest.fixture
def rig(any_dog):
    """Return a kinematic dog, off, with each kind of drives."""
    return Rig(any_dog)


@pytest.fixture
def standing(rig):
    """Return a kinematic dog that stands."""
    rig.stand()
    return rig


@pytest.fixture
def write_dog(tmp_path):
    """Write the example description with replaced text; return its path."""

    def write(*changes):
        text = EXAMPLE.read_text()
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / "dog.yaml"
        path.write_text(text)
        return path

    return write


TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def config(**changes):
    return QuadrupedConfig(
        **{"name": "rex", "twin": TWIN, "adapter": "quadruped", "link": "sim:kinematic"} | changes
    )


class LiveRobot(RecordingRobot):
    """A robot whose wheel turns by itself in real time."""

    def __init__(self):
        super().__init__("rex")
        self.clock = SystemClock()
        self.tasks = []

    def every(self, seconds, call):
        async def turn():
            while True:
                await asyncio.sleep(seconds)
                call()

        self.tasks.append(asyncio.create_task(turn()))


@contextlib.asynccontextmanager
async def _running(**changes):
    robot = LiveRobot()
    adapter = QuadrupedAdapter(config(**changes), robot)
    run = asyncio.create_task(serve(adapter))
    try:
        found = asyncio.create_task(robot.until(lambda: len(robot.healths) > 1))
        await asyncio.wait({found, run}, return_when=asyncio.FIRST_COMPLETED)
        found.cancel()
        if run.done():
            run.result()
        yield adapter, robot, run
    finally:
        for task in [*robot.tasks, run]:
            task.cancel()
        await asyncio.gather(*robot.tasks, run, return_exceptions=True)


@pytest.fixture
def running():
    """Return what runs an adapter in real time for a block: (adapter, robot, its run)."""
    return _running
