import asyncio
import importlib.util
from pathlib import Path

import pytest

from fleet.host.robot.adapter_factory import capabilities, create_adapter, start_command
from fleet.link.memory import MemoryRobot
from fleet.model.command import Command
from fleet.model.geometry import Vector3, Velocity, quaternion_from_yaw
from fleet.model.report import BatteryReport, PoseReport
from fleet.testing.contract import FrameContract
from fleet.testing.robot import RecordingRobot, serve

PATH = Path(__file__).parents[2] / "plugins" / "tracked_rover.py"
spec = importlib.util.spec_from_file_location("tracked_rover", PATH)
plugin = importlib.util.module_from_spec(spec)
spec.loader.exec_module(plugin)
TrackedRover = plugin.TrackedRover


def config(link="memory:rover"):
    return TrackedRover.Config(
        name="rover", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", adapter="tracked-rover", link=link
    )


class TestTheContract(FrameContract):
    adapter = TrackedRover
    config = {"adapter": "tracked-rover", "link": "serial:/dev/ttyUSB0?baud=115200"}
    said = (b"B 24.1 87\r\n", b"P 1.50 -2.25 0.785\n")

    def velocity_of(self, frame):
        word, *numbers = frame.split()
        return Velocity(Vector3(float(numbers[0])), float(numbers[1])) if word == b"M" else None


@pytest.fixture
def rover():
    return TrackedRover(config())


def test_a_velocity_becomes_one_line(rover):
    assert list(rover.drive(Velocity(Vector3(0.5), -1.0))) == [b"M 0.500 -1.000\n"]


def test_lamps_are_switched_without_moving():
    assert list(TrackedRover(config()).lights(on=False)) == [b"L 0\n"]
    assert not capabilities(TrackedRover).commands["lights"].moves


def test_a_battery_line_becomes_a_report(rover):
    assert list(rover.decode(b"B 24.1 87", 5.0)) == [BatteryReport(5.0, voltage=24.1, percent=87.0)]


def test_a_pose_line_becomes_a_report(rover):
    pose = PoseReport(5.0, Vector3(1.5, -2.25), quaternion_from_yaw(0.5))
    assert list(rover.decode(b"P 1.5 -2.25 0.5", 5.0)) == [pose]


@pytest.mark.parametrize(
    "line", [b"B 24.1", b"B 24.1 101", b"B nan 5", b"P 1 2", b"X 1 2", b"B 1 2 3", b"\xff"]
)
def test_a_line_that_makes_no_sense_says_nothing(rover, line):
    assert list(rover.decode(line, 5.0)) == []


async def test_it_drives_and_reports_over_a_link():
    robot = RecordingRobot()
    with MemoryRobot("drives", answer=lambda line: b"B 24.1 87\n") as machine:
        adapter = create_adapter(TrackedRover, config("memory:drives"), robot)
        run = asyncio.create_task(serve(adapter))
        await robot.until(lambda: robot.healths)
        adapter.drive(Velocity(Vector3(0.5)))
        await start_command(adapter, capabilities(TrackedRover).commands["lights"], Command("lights"))
        assert (await robot.first(BatteryReport)).percent == 87.0
        await adapter.stop("the test is over")
        assert machine.heard == [b"M 0.500 0.000\n", b"L 1\n", b"M 0 0\n"]
        run.cancel()
        await asyncio.gather(run, return_exceptions=True)
