"""Joints that somebody leads: the rules of a stream of motion, and what a robot with joints is told."""

import math
from typing import Any, Literal

import pytest

from fleet.adapter import Adapter, AdapterConfig
from fleet.errors import NotReady
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.controller import RobotController
from fleet.host.robot.joint_control import STEP
from fleet.model.command import Command, JointSetpoint, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity
from fleet.model.joints import JointRange
from fleet.model.report import JointReport, JointTags
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
LEAD = {"command": ["tele", "edge_leader"]}


class ArmConfig(AdapterConfig):
    adapter: Literal["arm"] = "arm"
    link: str = "memory:arm"


class Arm(Adapter[ArmConfig]):
    """Two joints that go where they are sent at once, and a record of what was told."""

    Config = ArmConfig
    failsafe = "it moves nothing"

    def __init__(self, config: ArmConfig) -> None:
        super().__init__(config, RecordingRobot())
        self.calls: list[Any] = []
        self.raises: BaseException | None = None
        self.meanwhile = lambda: None  # what another thread does while a target is written

    def drive(self, velocity):
        self.calls.append(velocity)

    async def stop(self, reason):
        self.calls.append("stop")

    def halt(self):
        self.calls.append("halt")

    def joint_ranges(self):
        return {"hip": JointRange(-1.0, 1.0, 2.0), "knee": JointRange(-2.0, 0.0, 1.0)}

    def move_joints(self, targets):
        if self.raises is not None:
            raise self.raises
        self.meanwhile()
        self.calls.append(dict(targets))

    def hold_joints(self):
        self.calls.append("hold")


class Bench:
    """A controller in front of an arm."""

    def __init__(self, *, measured: bool = True, **config: Any) -> None:
        self.clock = ManualClock()
        self.crashes: list[Exception] = []
        self.config = ArmConfig(name="arm", twin=TWIN, **config)
        self.controller = RobotController(
            self.config,
            capabilities(Arm),
            publish=lambda _: None,
            crashed=self.crashes.append,
            restart=lambda: None,
            journal=RobotJournal(),
            clock=self.clock,
        )
        self.arm = Arm(self.config)
        self.controller.attach(self.arm)
        self.controller.found()
        if measured:
            self.measure()

    def measure(self, hip=0.0, knee=-1.0):
        self.controller.joints.observe(JointReport(self.clock.time(), {"hip": hip, "knee": knee}))

    def lead(self, positions, *, age=0.0, session="ada", source="tele", **more):
        origin = Origin(Transport.CLOUD, source, session)
        request = JointSetpoint(positions, origin=origin, stamp=self.clock.time() - age, **more)
        return self.request(request)

    def request(self, request):
        answers: list[Any] = []
        self.controller.receive(request, Receipt(request.name, answers.append))
        return answers[0] if answers else None

    def run(self, seconds, *, again=None):
        """Let time pass, in steps, with a message in each."""
        for _ in range(round(seconds / STEP)):
            self.clock.advance(STEP)
            if again is not None:
                self.lead(again)
            self.controller.joints.step()

    @property
    def at(self):
        """Where the joints were sent last."""
        return next(each for each in reversed(self.arm.calls) if isinstance(each, dict))

    @property
    def moved(self):
        return any(isinstance(each, dict) for each in self.arm.calls)


@pytest.fixture
def bench():
    return Bench()


def test_a_joint_goes_to_its_target_no_faster_than_it_declares(bench):
    bench.lead({"hip": 1.0})
    assert bench.at["hip"] == pytest.approx(2.0 * STEP)
    bench.run(0.24, again={"hip": 1.0})
    assert bench.at["hip"] == pytest.approx(0.56)
    bench.run(1.0, again={"hip": 1.0})
    assert bench.at["hip"] == pytest.approx(1.0)


def test_a_loop_that_was_held_up_does_not_catch_up_in_a_jump(bench):
    bench.lead({"hip": 1.0})
    before = bench.at["hip"]
    bench.clock.advance(0.4)
    bench.controller.joints.step()
    assert bench.at["hip"] - before <= 0.2 + 1e-9


def test_one_target_is_followed_for_its_lease_and_not_a_moment_longer(bench):
    bench.lead({"knee": -2.0})
    bench.run(0.48)
    assert bench.controller.joints.deadman.expire(bench.clock.monotonic() + 0.021)
    before = len(bench.arm.calls)
    bench.run(1.0)
    assert len(bench.arm.calls) == before
    assert bench.at["knee"] == pytest.approx(-1.52)


def test_each_joint_lives_for_its_own_lease(bench):
    bench.lead({"knee": -2.0})
    bench.run(0.6, again={"hip": 0.1})
    stood = bench.at
    assert "knee" not in stood


@pytest.mark.parametrize(
    ("positions", "why"),
    [
        ({"hip": 1.01}, "outside -1 to 1"),
        ({"hip": math.nan}, "finite"),
        ({"hip": math.inf}, "finite"),
        ({"elbow": 0.0}, "no joint 'elbow'"),
        ({"hip": 0.1, "elbow": 0.0}, "no joint 'elbow'"),
    ],
)
def test_what_no_joint_can_do_is_refused_whole_with_the_reason(bench, positions, why):
    reply = bench.lead(positions)
    assert reply.status == "rejected"
    assert why in reply.reason
    assert not bench.moved


def test_one_whose_place_nobody_knows_is_not_led():
    bench = Bench(measured=False)
    assert "unknown" in bench.lead({"hip": 0.1}).reason
    bench.measure()
    bench.clock.advance(1.1)
    assert "unknown" in bench.lead({"hip": 0.1}).reason
    assert not bench.moved


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({"age": 0.9}, "0.90 s behind"),
        ({"age": -0.5}, "future"),
        ({"source": "edge_leader"}, "this robot accepts tele"),
        ({"source": "sim_tele"}, "this robot accepts tele"),
        ({"source": None}, "no source_type"),
    ],
)
def test_who_may_not_or_is_late_leads_nothing(bench, message, why):
    reply = bench.lead({"hip": 0.1}, **message)
    assert why in reply.reason
    assert not bench.moved


def test_a_leader_leads_where_it_is_accepted():
    bench = Bench(accepts=LEAD)
    assert bench.lead({"hip": 0.1}, source="edge_leader").ok


def test_an_older_target_than_the_last_is_refused(bench):
    assert bench.lead({"hip": 0.1}).ok
    assert "older than a setpoint" in bench.lead({"hip": 0.2}, age=0.1).reason


def test_another_session_waits_for_the_control_lease(bench):
    assert bench.lead({"hip": 0.1}).ok
    assert "ada has control" in bench.lead({"hip": 0.2}, session="bob").reason


async def test_a_stop_ends_the_stream_until_its_sender_lets_go(bench):
    bench.lead({"hip": 1.0})
    bench.clock.advance(STEP)
    bench.request(Command("stop", origin=Origin(Transport.CLOUD, "tele", "bob"), stamp=bench.clock.time()))
    assert "stop" in bench.lead({"hip": 1.0}).reason
    written = [each for each in bench.arm.calls if isinstance(each, dict)]
    bench.run(0.4, again={"hip": 1.0})
    assert [each for each in bench.arm.calls if isinstance(each, dict)] == written
    assert not bench.controller.in_motion
    bench.clock.advance(1.0)
    bench.measure()
    bench.clock.advance(0.2)
    assert bench.lead({"hip": 1.0}).ok


def test_an_emergency_stop_on_another_thread_ends_it_before_the_next_step_and_undoes_one_under_way(bench):
    bench.lead({"hip": 1.0})
    bench.arm.meanwhile = lambda: bench.controller.emergency("asked by a test")
    bench.clock.advance(STEP)
    bench.controller.joints.step()
    assert bench.arm.calls[-1] == "hold"
    before = len(bench.arm.calls)
    bench.arm.meanwhile = lambda: None
    bench.run(0.4)
    assert not any(isinstance(each, dict) for each in bench.arm.calls[before:])
    assert "emergency stop" in bench.lead({"hip": 1.0}).reason


def test_the_dead_man_that_fires_while_a_target_is_written_has_the_last_word(bench):
    bench.lead({"hip": 1.0})
    deadman = bench.controller.joints.deadman
    bench.arm.meanwhile = lambda: deadman.expire(math.inf) and bench.controller.joints.hold()
    bench.clock.advance(STEP)
    bench.controller.joints.step()
    assert bench.arm.calls[-1] == "hold"
    assert not bench.controller.in_motion


def test_velocities_do_not_keep_joints_going_nor_joints_velocities(bench):
    bench.request(Setpoint(Velocity(Vector3(0.1)), origin=Origin(Transport.CLOUD, "tele", "ada")))
    bench.lead({"hip": 1.0})
    assert bench.controller.deadman is not bench.controller.joints.deadman
    bench.run(0.4, again={"hip": 1.0})
    assert bench.controller.deadman.expire(bench.clock.monotonic() + 0.11)


def test_relative_targets_count_from_where_the_joint_is_and_once(bench):
    assert bench.lead({"hip": 0.1}, relative=True, id="a").ok
    bench.run(0.4)
    assert bench.at["hip"] == pytest.approx(0.1)
    assert "once more" in bench.lead({"hip": 0.1}, relative=True, id="a").reason
    assert "outside" in bench.lead({"hip": 5.0}, relative=True, id="b").reason


def test_an_adapter_that_does_not_take_a_target_ends_what_it_led(bench):
    bench.lead({"hip": 1.0})
    bench.arm.raises = NotReady("not now")
    assert bench.lead({"hip": 1.0}).reason == "not now"
    assert bench.arm.calls[-1] == "hold"
    assert not bench.controller.in_motion


def test_an_adapter_that_fails_is_halted_and_the_runner_hears_of_it(bench):
    bench.arm.raises = ZeroDivisionError()
    assert "the adapter failed" in bench.lead({"hip": 1.0}).reason
    assert bench.arm.calls == ["halt"]
    assert isinstance(bench.crashes[0], ZeroDivisionError)


def test_a_robot_without_joints_refuses_them(desk_without_joints):
    assert "takes no joint targets" in desk_without_joints


@pytest.fixture
def desk_without_joints():
    class Base(Arm):
        move_joints = Adapter.move_joints

    bench = Bench()
    controller = RobotController(
        bench.config,
        capabilities(Base),
        publish=lambda _: None,
        crashed=bench.crashes.append,
        restart=lambda: None,
        journal=RobotJournal(),
        clock=bench.clock,
    )
    answers: list[Any] = []
    controller.receive(JointSetpoint({"hip": 0.1}), Receipt("joint_targets", answers.append))
    return answers[0].reason


def test_where_the_leader_of_two_arms_of_one_twin_is_is_no_place_of_the_follower(bench):
    tags = JointTags(role="leader")
    bench.controller.joints.observe(JointReport(bench.clock.time(), {"hip": 0.9}, tags=tags))
    bench.lead({"hip": 0.0})
    assert bench.at["hip"] == pytest.approx(0.0)


# -- following a leader ------------------------------------------------------------------------------

LEADER = "6f0c9a1e-0000-4000-8000-000000000002"


@pytest.fixture
def follower():
    return Bench(accepts=LEAD, follows=LEADER)


def leader_at(bench, hip, *, age=0.0):
    """Return what the leader's joints ask of the follower."""
    return bench.controller.joints.following(
        JointReport(bench.clock.time() - age, {"hip": hip, "wheel": 7.0})
    )


def follow(bench, session="ada"):
    """Request to follow the leader; return the answers, which may follow later."""
    answers: list[Any] = []
    request = Command(
        "follow_leader", origin=Origin(Transport.CLOUD, "tele", session), stamp=bench.clock.time()
    )
    bench.controller.receive(request, Receipt(request.name, answers.append))
    return answers


def leads(bench, request):
    """Take what the leader asks, as the robot does; return the answer."""
    answer = bench.request(request)
    bench.controller.joints.followed(answer)
    return answer


def test_a_leader_asks_nothing_before_somebody_has_it_followed(follower):
    assert leader_at(follower, 0.5) is None
    answers = follow(follower)
    assert answers == [], "nobody has seen it follow"
    request = leader_at(follower, 0.5)
    assert (request.positions, request.origin.source_type) == ({"hip": 0.5}, "edge_leader")
    assert leads(follower, request).ok
    assert [each.done for each in answers] == [True]


def test_following_is_refused_while_the_robot_is_offline(follower):
    follower.controller.lost("silent")
    assert [each.reason for each in follow(follower)] == ["arm is offline: silent"]
    follower.controller.found()
    assert leader_at(follower, 0.5) is None
    follower.controller.detach("it begins anew")
    assert [each.ok for each in follow(follower)] == [False]


def test_following_is_not_done_when_the_leader_tells_nothing(follower):
    answers = follow(follower)
    follower.clock.advance(0.51)
    assert follower.controller.joints.deadman.expire(follower.clock.monotonic())
    follower.controller.joints.step()
    assert [each.reason for each in answers] == [
        "it follows no leader: no report of it within 0.5 s, or something else came first"
    ]


def test_following_is_not_done_when_the_robot_refuses_the_leaders_first_targets(follower):
    answers = follow(follower)
    follower.arm.raises = NotReady("not in joint mode", hint="send joint_mode first")
    assert not leads(follower, leader_at(follower, 0.5)).ok
    assert "not in joint mode" in answers[0].reason
    assert leader_at(follower, 0.5) is None


async def test_following_is_not_done_when_a_stop_comes_first(follower):
    answers = follow(follower)
    follower.request(
        Command("stop", origin=Origin(Transport.CLOUD, "tele", "bob"), stamp=follower.clock.time())
    )
    follower.controller.joints.step()
    assert [each.ok for each in answers] == [False]


async def test_a_stop_ends_the_following_until_it_is_asked_for_again(follower):
    follow(follower)
    follower.request(leader_at(follower, 0.5))
    follower.request(
        Command("stop", origin=Origin(Transport.CLOUD, "tele", "bob"), stamp=follower.clock.time())
    )
    assert leader_at(follower, 0.5) is None


def test_a_leader_that_fell_silent_is_not_followed_again_by_itself(follower):
    follow(follower)
    follower.request(leader_at(follower, 0.5))
    follower.run(0.48)
    assert follower.controller.joints.deadman.expire(follower.clock.monotonic() + 0.1)
    follower.lead({"knee": -1.0})
    assert leader_at(follower, 0.5) is None


def test_a_leader_that_is_late_or_out_of_range_does_not_lead(follower):
    follow(follower)
    assert "0.90 s behind" in follower.request(leader_at(follower, 0.5, age=0.9)).reason
    assert "outside" in follower.request(leader_at(follower, 1.5)).reason
    assert not follower.moved


def test_following_waits_for_an_emergency_stop_to_be_released(follower):
    follower.controller.emergency("a test")
    assert "emergency stop" in follow(follower)[0].reason
    assert leader_at(follower, 0.5) is None


@pytest.mark.parametrize(
    ("config", "why"),
    [
        ({"follows": TWIN, "accepts": LEAD}, "cannot follow itself"),
        ({"follows": LEADER}, "put edge_leader into accepts.command"),
        ({"follows": LEADER, "accepts": LEAD, "role": "leader"}, "a leader is not led"),
        ({"accepts": LEAD, "role": "leader"}, "it would follow its own state"),
    ],
)
def test_no_robot_is_its_own_leader(config, why):
    with pytest.raises(ValueError, match=why):
        ArmConfig(name="arm", twin=TWIN, **config)
