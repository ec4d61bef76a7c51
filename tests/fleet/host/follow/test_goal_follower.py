"""The follower of a robot: newest pose in, velocities out, and nothing by a pose that is too old."""

import asyncio
import types
import uuid

import pytest

from fleet.errors import NotReady, Refused
from fleet.host.follow.goal_follower import (
    LOST,
    PERIOD,
    SHARE,
    STALE,
    goal_follower_of,
    goal_navigator,
)
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import (
    ZERO_VELOCITY,
    Vector3,
    quaternion_from_euler,
    rotate_to_world,
)
from fleet.model.navigation import Constraints, FollowPath, FollowRobot, Goal, GoTo, RelativeMove
from fleet.model.report import BatteryReport, PoseReport
from fleet.robot_config import AdapterConfig, Limits
from fleet.testing.clock import JumpingLoop, LoopClock

LIMITS = Limits(speed=1.0, yaw_rate=2.0)


class Robot:
    """A robot that does what it is told and reports its pose, unless it is ``silent``."""

    def __init__(self, *, limits=LIMITS, holonomic=False, other=None, **config):
        self.clock = LoopClock(asyncio.get_running_loop())
        self.x = self.y = self.yaw = 0.0
        self.silent = False
        self.velocities = []
        self.follower = goal_follower_of(
            AdapterConfig(name="rex", twin=uuid.uuid4(), **config),
            self.velocities.append,
            limits,
            self.clock,
            other,
            holonomic=lambda: holonomic,
        )

    def report(self):
        rotation = quaternion_from_euler(0.0, 0.0, self.yaw)
        self.follower.observe(PoseReport(self.clock.time(), Vector3(self.x, self.y), rotation))

    def go(self):
        """Do the last velocity for a period, and report."""
        velocity = self.velocities[-1]
        moved = rotate_to_world(velocity.linear, self.yaw)
        self.x, self.y = self.x + moved.x * PERIOD, self.y + moved.y * PERIOD
        self.yaw += velocity.yaw_rate * PERIOD
        if not self.silent:
            self.report()

    async def navigate(self, task, *, steps=2000, each=lambda _step: None):
        """Carry a task out, for so many steps at the most; return its progress."""
        found = []
        async for progress in self.follower.navigate(task):
            found.append(progress)
            each(len(found))
            self.go()
            if len(found) == steps:
                break
        return found


def in_jumping_time(work):
    """Run ``work()`` in time that jumps; return what it returns."""
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(work())


PATH = FollowPath((Goal(Vector3(1.0)), Goal(Vector3(2.0, 1.0))))


def goto(x, y, **constraints):
    return GoTo(Goal(Vector3(x, y)), Constraints(**constraints))


@pytest.mark.parametrize("holonomic", [False, True])
@pytest.mark.parametrize("task", [goto(2.0, 1.0), PATH, RelativeMove(Vector3(2.0, 1.0))])
def test_a_goal_is_reached_and_the_robot_told_to_stand(task, holonomic):
    async def work():
        robot = Robot(holonomic=holonomic)
        robot.report()
        progress = await robot.navigate(task)
        return robot, progress

    robot, progress = in_jumping_time(work)
    assert (robot.x, robot.y) == (pytest.approx(2.0, abs=0.1), pytest.approx(1.0, abs=0.1))
    assert robot.velocities[-1] == ZERO_VELOCITY
    assert progress[-1].percent == 99.0
    assert len(robot.velocities) == len(progress) + 1


@pytest.mark.parametrize(
    ("limits", "requested", "fastest"),
    [
        (LIMITS, None, 1.0),
        (LIMITS, 0.4, 0.4),
        (LIMITS, 3.0, 1.0),
        (Limits(), None, 1.0),
        (Limits(), 0.5, 0.5),
    ],
)
def test_the_robot_is_as_fast_as_both_its_limits_and_the_task_allow(limits, requested, fastest):
    async def work():
        robot = Robot(limits=limits)
        robot.report()
        await robot.navigate(goto(9.0, 0.0, max_speed=requested), steps=100)
        return max(velocity.linear.norm() for velocity in robot.velocities)

    assert in_jumping_time(work) == pytest.approx(fastest)


def test_it_turns_a_little_slower_than_it_could_and_by_new_limits_from_the_next_task_on():
    async def work():
        robot, fastest = Robot(), []
        for rate in (1.0, 0.5):
            robot.follower.configure(None, Limits(speed=1.0, yaw_rate=rate))
            robot.report()
            robot.velocities.clear()
            await robot.navigate(goto(robot.x - 5.0, robot.y + 0.1), steps=30)
            fastest.append(max(abs(velocity.yaw_rate) for velocity in robot.velocities))
            robot.yaw = 0.0
        return fastest

    assert in_jumping_time(work) == pytest.approx([SHARE, 0.5 * SHARE])


@pytest.mark.parametrize(
    ("age", "words"),
    [(None, "reported no pose"), (STALE + 0.1, "too old"), (LOST + 0.1, "no pose for 2.1 s")],
)
def test_nothing_begins_by_a_pose_that_is_too_old(age, words):
    async def work():
        robot = Robot()
        assert robot.follower.has_pose is False
        if age is not None:
            robot.report()
            await asyncio.sleep(age)
        with pytest.raises(NotReady, match=words):
            await robot.navigate(goto(1.0, 0.0))
        return robot.velocities

    assert in_jumping_time(work) == []


def test_a_robot_without_a_pose_for_a_moment_stands_and_for_longer_it_fails():
    async def work():
        robot = Robot()
        robot.report()

        def each(step):
            robot.silent = step >= 40

        with pytest.raises(NotReady, match=r"no pose for 2\.0 s"):
            await robot.navigate(goto(9.0, 0.0), each=each)
        return robot.velocities

    velocities = in_jumping_time(work)
    stands = velocities.index(ZERO_VELOCITY, 40)
    assert (stands - 40) * PERIOD == pytest.approx(STALE, abs=2 * PERIOD)
    assert set(map(repr, velocities[stands:])) == {repr(ZERO_VELOCITY)}
    assert (len(velocities) - 40) * PERIOD == pytest.approx(LOST, abs=3 * PERIOD)


def test_a_pose_that_comes_back_in_time_leads_it_on():
    async def work():
        robot = Robot()
        robot.report()

        def each(step):
            robot.silent = 40 <= step < 60

        await robot.navigate(goto(3.0, 0.0), each=each)
        return robot

    robot = in_jumping_time(work)
    assert ZERO_VELOCITY in robot.velocities[45:65]
    assert robot.x == pytest.approx(3.0, abs=0.1)


def test_only_poses_are_looked_at():
    async def work():
        robot = Robot()
        robot.follower.observe(BatteryReport(1.0, percent=80.0))
        return robot.follower.has_pose

    assert in_jumping_time(work) is False


def test_a_place_on_earth_needs_the_robots_origin():
    there = GoTo(Goal(geo=GeoPoint(47.00001, 8.0, 400.0)))

    async def work():
        with pytest.raises(Refused, match="needs the robot's origin"):
            await self_of({}).navigate(there)
        robot = self_of({"origin": {"latitude": 47.0, "longitude": 8.0, "altitude": 400.0}})
        await robot.navigate(there)
        return robot

    def self_of(config):
        robot = Robot(**config)
        robot.report()
        return robot

    robot = in_jumping_time(work)
    assert (robot.x, robot.y) == (pytest.approx(0.0, abs=0.1), pytest.approx(1.1, abs=0.2))


def test_another_robot_is_followed_where_it_is_seen():
    asked = []

    def other(name):
        asked.append(name)
        return Vector3(5.0, 0.0), 0.1

    async def work():
        robot = Robot(other=other)
        robot.report()
        progress = await robot.navigate(FollowRobot("ada", 2.0), steps=400)
        return robot, progress

    robot, progress = in_jumping_time(work)
    assert robot.x == pytest.approx(3.0, abs=0.2)
    assert set(asked) == {"ada"}
    assert {each.percent for each in progress} == {0.0}, "it has no end"


class Adapter:
    """An adapter that navigates by itself."""

    def navigate(self, task):
        return "adapter", task


def leader(*, has_pose):
    return types.SimpleNamespace(has_pose=has_pose, navigate=lambda task: ("leader", task))


@pytest.mark.parametrize(
    ("adapter", "navigates", "drives", "has_pose", "navigator"),
    [
        (Adapter(), True, True, False, "adapter"),
        (Adapter(), False, True, True, "leader"),
        (Adapter(), False, True, False, None),
        (Adapter(), False, False, True, None),
        (None, True, True, True, None),
    ],
)
def test_a_robot_that_navigates_does_so_and_any_other_is_led_once_its_pose_is_known(
    adapter, navigates, drives, has_pose, navigator
):
    found = goal_navigator(adapter, leader(has_pose=has_pose), navigates=navigates, drives=drives)
    task = goto(1.0, 0.0)
    assert (found and found.navigate(task)) == (navigator and (navigator, task))


def test_a_robot_that_navigates_by_itself_is_led_only_after_another():
    found = goal_navigator(Adapter(), leader(has_pose=True), navigates=True, drives=True)
    task = FollowRobot("ada", 2.0)
    assert found.navigate(task) == ("leader", task)
