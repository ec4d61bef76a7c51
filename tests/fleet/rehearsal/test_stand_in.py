"""The kinematic stand-in, in the time of its own event loop."""

import asyncio
import uuid

import pytest

from fleet.errors import NotReady, Unsupported
from fleet.host.robot.adapter_factory import capabilities, start_command
from fleet.model.command import Command
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Pose, Vector3, Velocity, quaternion_from_yaw
from fleet.model.navigation import Constraints, FlyMission, FollowPath, Goal, GoTo, RelativeMove
from fleet.model.report import BatteryReport, PoseReport
from fleet.rehearsal.stand_in import BATTERY, POSE, stand_in_for
from fleet.robot_config import Limits
from fleet.runtime.simulated_time import JumpingLoop
from fleet.testing.robot import LoopRobot
from tests.fleet.host.field import Flyer, Walker, WalkerConfig


def stand_in(work, played=Flyer, **config):
    """Run ``work(adapter, robot)`` with a stand-in at (1, 2, 0) that looks north."""

    async def whole():
        robot = LoopRobot("rex", Limits(speed=2.0))
        robot.state |= {POSE: Pose(Vector3(1.0, 2.0), quaternion_from_yaw(1.5707963)), BATTERY: 50.0}
        adapter = stand_in_for(played)(WalkerConfig(name="rex", twin=uuid.UUID(int=1), **config), robot)
        await adapter.connect()
        began = robot.clock.monotonic()
        try:
            result = await work(adapter, robot)
            seconds = robot.clock.monotonic() - began
            await asyncio.sleep(0.2)
        finally:
            robot.close()
        pose = robot.reports_of(PoseReport)[-1].position
        return result, round(seconds, 1), tuple(round(each, 1) for each in (pose.x, pose.y, pose.z)), robot

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


async def carried_out(adapter, task):
    return [progress.reached async for progress in adapter.navigate(task)][-1]


def to(*points):
    return FollowPath(tuple(Goal(Vector3(*point)) for point in points))


def test_it_declares_what_the_robot_declares():
    for played in (Walker, Flyer):
        real, made = capabilities(played), capabilities(stand_in_for(played))
        assert (made.drives, made.navigates, made.limits, made.separation, made.holonomic) == (
            real.drives,
            real.navigates,
            real.limits,
            real.separation,
            real.holonomic,
        )
        assert set(made.commands) == set(real.commands)


def test_it_goes_to_points_at_the_speed_that_it_is_allowed():
    reached, seconds, at, _ = stand_in(lambda adapter, _: carried_out(adapter, to((1, 6), (5, 6))))
    assert (reached, at) == (1, (5.0, 6.0, 0.0))
    assert 4.0 <= seconds <= 4.5
    slow = GoTo(Goal(Vector3(1.0, 3.0)), Constraints(max_speed=0.5))
    assert 2.0 <= stand_in(lambda adapter, _: carried_out(adapter, slow))[1] <= 2.3
    step = RelativeMove(Vector3(1.0))
    assert stand_in(lambda adapter, _: carried_out(adapter, step))[2] == (1.0, 3.0, 0.0)


def test_it_holds_a_body_velocity_until_it_is_halted():
    async def work(adapter, _):
        adapter.drive(Velocity(Vector3(1.0)))
        await asyncio.sleep(2.0)
        await adapter.stop("stop")
        await asyncio.sleep(2.0)

    assert stand_in(work)[2] == (1.0, 4.0, 0.0)


def test_take_off_and_landing_change_its_height_and_other_commands_take_a_second():
    async def request(adapter, name, **data):
        spec = adapter.commands()[name]
        await start_command(adapter, spec, Command(name, data))

    assert stand_in(lambda adapter, _: request(adapter, "takeoff", altitude=4.0))[2] == (1.0, 2.0, 4.0)

    async def down(adapter, _):
        await request(adapter, "takeoff", altitude=4.0)
        await request(adapter, "land")

    assert stand_in(down)[2] == (1.0, 2.0, 0.0)


def test_its_battery_drains_while_it_moves_where_fleet_yaml_says_how_long_it_lasts():
    def left(**config):
        robot = stand_in(lambda adapter, _: carried_out(adapter, to((1, 12))), **config)[3]
        return [report.percent for report in robot.reports_of(BatteryReport)]

    assert set(left()) == {50.0}
    drained = left(battery_policy={"endurance": 100.0})
    assert drained == sorted(drained, reverse=True)
    assert 45.0 <= drained[-1] < 50.0


def test_a_halt_on_the_way_ends_the_task_as_not_done():
    async def work(adapter, robot):
        asyncio.get_running_loop().call_later(0.5, adapter.halt)
        with pytest.raises(NotReady, match="halted"):
            await carried_out(adapter, to((1, 12)))

    stand_in(work)


@pytest.mark.parametrize("task", [FlyMission("field", ()), GoTo(Goal(geo=GeoPoint(47.0, 8.0)))])
def test_it_knows_nothing_of_the_earth(task):
    async def work(adapter, _):
        with pytest.raises(Unsupported, match="Earth"):
            await carried_out(adapter, task)

    stand_in(work)
