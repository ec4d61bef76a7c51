import asyncio
import contextlib

import pytest

from fleet.errors import LinkLost
from fleet.model.health import Health
from fleet.model.report import BatteryReport
from fleet.testing.robot import LoopRobot, RecordingRobot


def test_calls_are_made_when_they_are_due_and_in_order():
    robot, made = RecordingRobot(), []
    start = robot.clock.monotonic()
    for period in (1.0, 0.4):
        robot.every(period, lambda period=period: made.append((period, robot.clock.monotonic() - start)))
    robot.advance(1.25)
    assert made == [
        (0.4, pytest.approx(0.4)),
        (0.4, pytest.approx(0.8)),
        (1.0, 1.0),
        (0.4, pytest.approx(1.2)),
    ]
    assert robot.clock.monotonic() - start == pytest.approx(1.25)


def test_what_a_call_raises_is_raised_to_the_test():
    def lost():
        raise LinkLost("silent")

    robot = RecordingRobot()
    robot.every(1.0, lost)
    with pytest.raises(LinkLost):
        robot.advance(1.0)


async def test_a_test_waits_for_what_was_recorded():
    robot, report = RecordingRobot(), BatteryReport(1.0, percent=50.0)
    asyncio.get_running_loop().call_soon(robot.report, report)
    assert await robot.first(BatteryReport) is report
    robot.health(Health())
    robot.authority_lost("a pilot took over")
    assert (robot.healths, robot.losses) == ([Health()], ["a pilot took over"])


async def test_waiting_for_what_never_comes_ends():
    with pytest.raises(TimeoutError):
        await RecordingRobot().until(lambda: False, within=0.01)


async def test_a_lone_robot_shares_with_nobody():
    async with RecordingRobot().share("port", lambda: contextlib.nullcontext(7)) as value:
        assert value == 7


async def test_a_robot_in_the_loops_time_makes_its_calls_until_it_is_closed():
    robot, made = LoopRobot(), []
    enough = asyncio.Event()
    robot.every(0.001, lambda: made.append(robot.clock.monotonic()) or len(made) < 3 or enough.set())
    await asyncio.wait_for(enough.wait(), 60)
    robot.close()
    count = len(made)
    await asyncio.sleep(0.01)
    assert len(made) == count
    assert made == sorted(made)
