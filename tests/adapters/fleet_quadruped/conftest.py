import asyncio
import contextlib
import functools

import pytest

from fleet.clock import SystemClock
from fleet.testing.robot import RecordingRobot, serve
from fleet_quadruped import QuadrupedAdapter, QuadrupedConfig
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.robot.description import EXAMPLE, DogDescription, load_description
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Actuator
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copy_of, quick, standing_dog

PROTOCOLS = ("cia402", "mit", "odrive", "moteus")
_SENSORS = {
    "imu": 0x600,
    "battery": 0x400,
    "led": 0x600,
}  # added to their frames: ODrives have the first ones


def speaking(dog, protocol, profile="damiao-8006"):
    """Return the same dog with other drives."""
    tree = dog.model_dump(by_alias=True)
    tree["drive"] |= {"protocol": protocol, "profile": profile}
    if protocol == "odrive":
        tree["drive"]["endpoints"] = {"enable_watchdog": 241, "watchdog_timeout": 242}
        for name, more in _SENSORS.items():
            for frame in tree[name].get("frames", [tree[name]]):
                frame["id"] += more
    if protocol == "moteus":
        tree["buses"]["a"]["data_bitrate"] = 5_000_000
    return DogDescription.model_validate(tree)


@pytest.fixture(scope="session")
def dog():
    return load_description(EXAMPLE)


@pytest.fixture(params=PROTOCOLS)
def any_dog(dogs, request):
    """Return the example dog with each kind of drives."""
    return dogs[request.param]


@pytest.fixture(scope="session")
def dogs(dog):
    """Return the example dog with each kind of drives, by their protocol."""
    return {protocol: speaking(dog, protocol) for protocol in PROTOCOLS}


@pytest.fixture(scope="session")
def mit_dog(dogs):
    return dogs["mit"]


@pytest.fixture
def stopped_alone():
    """Return what tells whether all drives have stopped by themselves: held (CiA 402), or limp or damped."""

    def judge(rig):
        if rig.dog.drive.protocol != "cia402":
            return all(motor.kp == 0 for motor in rig.sim.world.motors)
        held = all(motor.kp > 0 for motor in rig.sim.world.motors)
        return held and {drive.state for drive in rig.sim.drives} == {DriveState.QUICK_STOP}

    return judge


@pytest.fixture
def rig(any_dog):
    """Return a kinematic dog, off, with each kind of drives; it stands up in less time."""
    return copy_of(Rig, quick(any_dog))


@pytest.fixture
def standing(any_dog):
    """Return a kinematic dog that stands."""
    return standing_dog(any_dog)


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


def make_joint(name="FL_knee", *, bus="a", number=3, sign=1, offset=0.0, **kind):
    """Return a joint whose torque is 24 N m, with the rest of its kind as given."""
    basics = {"limits": (-2.0, 2.0), "velocity": 20.0, "torque": 24.0, "kp": 60.0, "kd": 2.0}
    return Joint(name, bus, number, sign, offset, -2.0, 2.0, Actuator(**basics | kind))


@pytest.fixture
def joint_of():
    return make_joint


TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def config(**changes):
    return QuadrupedConfig(
        **{"name": "rex", "twin": TWIN, "adapter": "quadruped", "link": "sim:kinematic"} | changes
    )


class LiveRobot(RecordingRobot):
    """A robot whose periodic calls are made in real time."""

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


@pytest.fixture(scope="session")
def quick_body(tmp_path_factory):
    """Return the path of the example description of a dog that stands up and sits down quickly."""
    path = tmp_path_factory.mktemp("quick") / "dog.yaml"
    text = EXAMPLE.read_text()
    for slow, fast in (("rise_time: 1.5", "rise_time: 0.6"), ("sit_time: 1.2", "sit_time: 0.6")):
        assert slow in text
        text = text.replace(slow, fast)
    path.write_text(text)
    return path


@pytest.fixture
def running(quick_body):
    """Return what runs an adapter in real time for a block: (adapter, robot, its run)."""
    return functools.partial(_running, body=quick_body)
