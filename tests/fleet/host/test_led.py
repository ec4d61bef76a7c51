"""A robot that drives and tells its pose is led by the host, through the controller's clamp and dead-man."""

import asyncio
import math

import pytest

from fleet.adapter import Adapter
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.controller import RobotController
from fleet.host.robot.distance_moves import goal_of
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity, quaternion_from_yaw
from fleet.model.navigation import (
    Constraints,
    Control,
    FlyMission,
    FollowPath,
    Goal,
    GoTo,
    Navigate,
    PlanItem,
)
from fleet.model.report import NavigationReport, PoseReport
from fleet.robot_config import AdapterConfig, Limits
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot

TELE = Origin(Transport.CLOUD, "tele", "anna")


class CartConfig(AdapterConfig):
    adapter: str = "cart"
    link: str = "memory:cart"


class Cart(Adapter[CartConfig]):
    """A robot that does exactly what it is told."""

    Config = CartConfig
    limits = Limits(speed=0.5, yaw_rate=1.0)
    failsafe = "it moves nothing"
    combines_keys = True

    def __init__(self, config):
        super().__init__(config, RecordingRobot())
        self.velocity = Velocity()
        self.velocities = []

    def drive(self, velocity):
        self.velocity = velocity
        self.velocities.append(velocity)

    async def stop(self, reason):
        self.halt()

    def halt(self):
        self.velocity = Velocity()


class World:
    """A cart, its controller, and a loop that makes time pass without waiting."""

    def __init__(self, monkeypatch):
        self.clock = ManualClock()
        self.reports = []
        config = CartConfig(name="cart", twin="6f0c9a1e-0000-4000-8000-000000000001")
        self.cart = Cart(config)
        self.controller = RobotController(
            config,
            capabilities(Cart),
            publish=self.reports.append,
            crashed=self._crashed,
            journal=RobotJournal(),
            restart=lambda: None,
            clock=self.clock,
        )
        self.x = self.y = self.yaw = 0.0
        self.expired = 0
        self.tells = True
        self.controller.attach(self.cart)
        self.controller.found()
        self._sleep = asyncio.sleep
        monkeypatch.setattr("fleet.host.follow.goal_follower.asyncio.sleep", self.pass_time)

    def _crashed(self, error):
        raise error

    async def pass_time(self, seconds):
        await self._sleep(0)
        self.clock.advance(seconds)
        if self.controller.deadman.expire(self.clock.monotonic()):
            self.expired += 1
            self.controller.halt()
        velocity = self.cart.velocity
        self.x += velocity.linear.x * math.cos(self.yaw) * seconds
        self.y += velocity.linear.x * math.sin(self.yaw) * seconds
        self.yaw += velocity.yaw_rate * seconds
        self.observe()

    def observe(self):
        if self.tells:
            stamp = self.clock.time()
            self.controller.observe(PoseReport(stamp, Vector3(self.x, self.y), quaternion_from_yaw(self.yaw)))

    def request(self, what):
        answers = []
        self.controller.receive(what, Receipt("it", answers.append))
        return answers

    def states(self):
        return [str(report.state) for report in self.reports if isinstance(report, NavigationReport)]

    async def until(self, condition):
        for _ in range(20000):
            if condition():
                return
            await self._sleep(0)
        raise AssertionError(self.reports[-3:])


@pytest.fixture
async def world(monkeypatch):
    return World(monkeypatch)


def goal(x, y, yaw=None, action="a1", **more):
    return Navigate(GoTo(Goal(Vector3(x, y), yaw=yaw), **more), action, TELE)


async def test_it_goes_to_a_goal_and_says_so_once(world):
    world.observe()
    (first,) = world.request(goal(1.0, 1.0, yaw=0.0))
    assert first.ok
    await world.until(lambda: world.states()[-1] == "completed")
    assert (world.x, world.y, world.yaw) == pytest.approx((1.0, 1.0, 0.0), abs=0.1)
    assert world.states()[:2] == ["queued", "running"]
    assert world.states().count("completed") == 1
    assert world.expired == 0
    said = [report for report in world.reports if isinstance(report, NavigationReport)]
    left = [report.remaining for report in said if report.remaining is not None]
    assert left[0] == pytest.approx(math.sqrt(2), abs=0.1)
    assert sorted(left, reverse=True) == left
    assert any(report.eta for report in said)
    assert (said[-1].remaining, said[-1].eta) == (None, None)


@pytest.mark.parametrize(("verb", "x"), [("move_forward", 1.0), ("move_backward", -1.0)])
async def test_a_verb_with_a_distance_ends_there_and_its_repeat_moves_nothing(world, verb, x):
    world.observe()
    can = capabilities(Cart)
    move = goal_of(Command(verb, {"distance": 1.0}, TELE, id="q1"), can, VerbSpeeds(can.limits).of)
    (first,) = world.request(move)
    assert first.ok
    await world.until(lambda: world.states()[-1] == "completed")
    assert (world.x, world.y) == pytest.approx((x, 0.0), abs=0.05)
    assert (world.cart.velocity, world.controller.deadman.armed) == (Velocity(), False)
    world.cart.velocities.clear()
    world.request(move)
    await world.pass_time(1.0)
    assert world.cart.velocities == []
    assert world.controller.last.command == verb


async def test_without_a_pose_it_is_not_led_and_the_reason_is_reported(world):
    (first,) = world.request(goal(1.0, 1.0))
    assert "has reported no pose" in first.reason
    assert world.states() == ["failed"]


async def test_what_the_follower_asks_is_clamped_and_has_a_lease(world):
    world.observe()
    world.request(goal(3.0, 0.0, constraints=Constraints(max_speed=9.0)))
    await world.until(lambda: world.states()[-1] == "completed")
    assert max(velocity.linear.x for velocity in world.cart.velocities) == pytest.approx(0.5)
    assert not world.controller.deadman.armed


async def test_an_asker_may_slow_it_down(world):
    world.observe()
    world.request(goal(2.0, 0.0, constraints=Constraints(max_speed=0.2)))
    await world.until(lambda: world.states()[-1] == "completed")
    assert max(velocity.linear.x for velocity in world.cart.velocities) <= 0.2 + 1e-9


async def test_a_robot_that_tells_no_pose_any_more_is_stopped_and_the_action_fails(world):
    world.observe()
    world.request(goal(3.0, 0.0))
    await world.until(lambda: world.x > 0.5)
    world.tells = False
    await world.until(lambda: world.states()[-1] == "failed")
    assert "no pose" in world.reports[-1].message
    assert world.cart.velocity.is_zero
    assert world.x < 0.5 + 0.6 * 0.5


async def test_teleoperation_takes_over(world):
    world.observe()
    world.request(goal(3.0, 0.0))
    await world.until(lambda: world.x > 0.5)
    world.request(Setpoint(Velocity(yaw_rate=0.5), origin=TELE))
    await world.until(lambda: world.states()[-1] == "cancelled")
    assert world.cart.velocity == Velocity(yaw_rate=0.5)


async def test_once_a_lease_has_run_out_all_keys_are_up(world):
    world.request(Setpoint(Velocity(Vector3(x=0.3)), "move_forward", origin=TELE))
    world.clock.advance(0.3)
    world.request(Setpoint(Velocity(yaw_rate=0.5), "turn_left", origin=TELE))
    world.clock.advance(0.2)
    assert world.controller.deadman.expire(world.clock.monotonic())
    world.controller.motion.lease_ran_out()
    world.request(Setpoint(Velocity(Vector3(x=0.3)), "move_forward", origin=TELE))
    assert world.cart.velocity == Velocity(Vector3(x=0.3))


async def test_an_emergency_stop_ends_it_and_nothing_drives_after(world):
    world.observe()
    world.request(goal(3.0, 0.0))
    await world.until(lambda: world.x > 0.5)
    world.controller.emergency("test")
    before = len(world.cart.velocities)
    world.request(Command("emergency_stop", origin=TELE))
    await world.until(lambda: world.states()[-1] == "cancelled")
    assert [velocity for velocity in world.cart.velocities[before:] if not velocity.is_zero] == []


async def test_a_newer_goal_takes_the_place_of_the_older(world):
    world.observe()
    world.request(goal(3.0, 0.0, action="a1"))
    await world.until(lambda: world.x > 0.5)
    world.request(goal(0.0, 0.0, action="a2"))
    await world.until(lambda: world.states()[-1] == "completed")
    assert world.states().count("cancelled") == 1
    assert (world.x, world.y) == pytest.approx((0.0, 0.0), abs=0.1)


async def test_a_paused_path_goes_on_with_what_is_left_of_it(world):
    world.observe()
    path = FollowPath((Goal(Vector3(1.0)), Goal(Vector3(1.0, 1.0)), Goal(Vector3(0.0, 1.0))), loops=1)
    world.request(Navigate(path, "p1", TELE))
    await world.until(lambda: world.y > 0.5)
    world.request(Navigate(Control.PAUSE, "", TELE))
    await world.until(lambda: world.cart.velocity.is_zero)
    before = len(world.cart.velocities)
    world.request(Navigate(Control.RESUME, "", TELE))
    await world.until(lambda: world.states()[-1] == "completed")
    assert len(world.cart.velocities) > before
    assert (world.x, world.y) == pytest.approx((0.0, 1.0), abs=0.1)


async def test_keys_that_are_held_together_combine_and_a_stop_lifts_them(world):
    world.request(Setpoint(Velocity(Vector3(0.4)), "move_forward", origin=TELE))
    world.request(Setpoint(Velocity(yaw_rate=0.6), "turn_left", origin=TELE))
    assert world.cart.velocity == Velocity(Vector3(0.4), 0.6)
    world.request(Command("stop", origin=TELE))
    await world.until(lambda: world.cart.velocity.is_zero)
    world.request(Setpoint(Velocity(yaw_rate=0.6), "turn_left", origin=TELE))
    assert world.cart.velocity == Velocity(yaw_rate=0.6)


async def test_a_mission_is_refused_at_once_by_a_robot_that_has_none(world):
    replies = []
    request = Navigate(FlyMission("field", (PlanItem("return_to_launch"),)), "m1", TELE, world.clock.time())
    world.controller.receive(request, Receipt("start", replies.append, waits=True))
    (reply,) = replies
    assert (reply.ok, "carries out no missions" in reply.reason) == (False, True)
