"""The host's follower leads the simulated Beast: bytes, counters, gyro and all, but no real time."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet import Pose, Vector3, quaternion_from_yaw
from fleet.host.follow.leg_follower import TOLERANCE, LegFollower
from fleet.host.follow.legs import Leg
from fleet.host.follow.motion_laws import MotionLimits
from fleet.model.geometry import wrap_angle
from fleet_ugv.kinematics import Differential
from fleet_ugv.model import Feedback
from fleet_ugv.odometry import Scale, WheelOdometry
from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.spec import BaseSpec, board_of

PERIOD = 0.05
SEEDS = st.integers(0, 2**16)
CODEC_SETTING = {"timeout": 0.5, "module": 0, "ticks": 4000.0, "diameter": 0.165, "servo": None}


class Drive:
    """A base from wheels to pose, without a line and without waiting."""

    def __init__(self, profile="waveshare-beast", seed=1):
        kind = PROFILES[profile]
        self.board = board_of(BaseSpec(profile, seed=seed))
        self.codec = kind.codec(type("Setting", (), CODEC_SETTING))
        self.kinematics = Differential(kind.track, kind.fastest)
        wrap = kind.counter / kind.ticks if kind.counter else None
        self.odometry = WheelOdometry(Scale(kind.track, wrap=wrap), kind.fastest)
        self.pace = MotionLimits(kind.limits.speed, kind.limits.yaw_rate * 0.9)
        self.now = 0.0
        self.fastest = 0.0
        self.sideways = 0.0
        self.turns = 0
        for _ in range(100):  # it boots, and its gyro settles
            self.tell(self.codec.setup() if self.now == 1.0 else b"")

    @property
    def pose(self):
        return self.odometry.pose

    def tell(self, data):
        self.now = round(self.now + PERIOD, 6)
        said = self.board.receive(data, self.now) if data else b""
        for event in self.codec.feed(said + self.board.step(self.now)):
            if isinstance(event, Feedback):
                self.odometry.update(event, self.now)

    def go(self, *legs, speed=None, within=300.0, tolerance=TOLERANCE):
        """Lead it along legs; returns the follower, done."""
        pace = MotionLimits(speed or self.pace.speed, self.pace.yaw_rate)
        follower = LegFollower(legs, self.pose, pace, tolerance=tolerance, holonomic=False, now=self.now)
        end, before, percent = self.now + within, 0.0, 0.0
        while not follower.done:
            assert self.now < end, (follower.phase, self.pose, legs)
            velocity = follower.step(self.pose, self.now)
            progress = follower.progress()
            assert percent <= progress.percent <= 99.0
            percent = progress.percent
            self.fastest = max(self.fastest, abs(velocity.linear.x))
            self.turns += velocity.yaw_rate * before < -0.01
            before = velocity.yaw_rate
            self.tell(self.codec.motion(self.kinematics.inverse(velocity)) + self.codec.poll())
        return follower

    def true_error(self, point, yaw):
        """Return how far it truly is from a goal: metres, degrees."""
        at = self.board.physics
        return math.dist((at.x, at.y), point), math.degrees(abs(wrap_angle(at.yaw - yaw)))


@settings(max_examples=10)
@given(SEEDS)
def test_it_arrives_at_random_goals_one_after_another_by_its_own_reckoning(seed):
    rng = random.Random(seed)
    drive = Drive()
    for _ in range(5):
        here = drive.pose.position
        goal = (here.x + rng.uniform(-2, 2), here.y + rng.uniform(-2, 2))
        yaw = rng.uniform(-math.pi, math.pi)
        drive.go(Leg((goal,), yaw))
        assert math.dist((drive.pose.position.x, drive.pose.position.y), goal) < 0.15
        assert math.degrees(abs(wrap_angle(drive.pose.rotation.yaw - yaw))) < 5.0


@settings(max_examples=50)
@given(SEEDS)
def test_it_truly_arrives_at_random_goals_that_it_starts_for_afresh(seed):
    rng = random.Random(seed)
    drive = Drive(seed=seed)
    goal, yaw = (rng.uniform(-2, 2), rng.uniform(-2, 2)), rng.uniform(-math.pi, math.pi)
    drive.go(Leg((goal,), yaw))
    off, turned = drive.true_error(goal, yaw)
    assert off < 0.15
    assert turned < 5.0


@pytest.mark.parametrize("speed", [0.1, 0.15, 0.2, 0.25, 0.3, 0.35])
def test_it_is_stable_from_a_tenth_of_a_metre_a_second_to_its_limit(speed):
    drive = Drive()
    drive.go(Leg(((1.0, 0.0), (1.5, 0.2), (2.0, 0.6), (2.2, 1.2), (3.0, 2.0)), 0.0), speed=speed)
    assert drive.true_error((3.0, 2.0), 0.0)[0] < 0.15
    assert drive.fastest <= speed + 1e-9
    assert drive.turns < 25  # changes of the turn's sense: an oscillation has hundreds


@pytest.mark.parametrize("profile", ["waveshare-rover", "ros-arduino", "hoverboard"])
def test_every_base_arrives(profile):
    drive = Drive(profile)
    drive.go(Leg(((1.5, 0.0), (1.5, 1.5)), math.pi))
    off, turned = drive.true_error((1.5, 1.5), math.pi)
    assert off < 0.15
    assert turned < 10.0


def test_a_square_closes_within_a_tenth_of_a_metre():
    drive = Drive()
    square = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
    drive.go(Leg(square * 2, 0.0))
    off, turned = drive.true_error((0.0, 0.0), 0.0)
    assert off < 0.1
    assert turned < 5.0


def test_a_corner_is_driven_to_and_not_cut():
    drive = Drive()
    nearest = math.inf
    pace = drive.pace
    follower = LegFollower(
        [Leg(((1.0, 0.0), (1.0, 1.0)))], drive.pose, pace, tolerance=0.1, holonomic=False, now=drive.now
    )
    while not follower.done:
        drive.tell(drive.codec.motion(drive.kinematics.inverse(follower.step(drive.pose, drive.now))))
        nearest = min(nearest, math.dist((drive.board.physics.x, drive.board.physics.y), (1.0, 0.0)))
    assert nearest < 0.1


def test_a_short_way_back_is_driven_backwards():
    drive = Drive()
    drive.go(Leg(((-0.5, 0.0),), backwards=True))
    off, turned = drive.true_error((-0.5, 0.0), 0.0)
    assert off < 0.12
    assert turned < 20


def test_a_stalled_base_is_blocked_in_3_to_5_seconds_stands_and_goes_on_when_it_can():
    drive = Drive()
    drive.board.set_fault("stall", 1.0)
    leg = Leg(((2.0, 0.0),))
    follower = LegFollower([leg], drive.pose, drive.pace, tolerance=0.1, holonomic=False, now=drive.now)
    began = drive.now
    while not follower.progress().blocked:
        drive.tell(drive.codec.motion(drive.kinematics.inverse(follower.step(drive.pose, drive.now))))
        assert drive.now - began < 6
    assert 3.0 <= drive.now - began <= 5.0
    assert follower.step(drive.pose, drive.now).is_zero
    drive.board.set_fault("stall", None)
    while not follower.done:
        assert drive.now - began < 60
        drive.tell(drive.codec.motion(drive.kinematics.inverse(follower.step(drive.pose, drive.now))))
    assert drive.true_error((2.0, 0.0), 0.0)[0] < 0.15


def test_a_base_that_stays_blocked_is_given_up():
    drive = Drive()
    drive.board.set_fault("stall", 1.0)
    with pytest.raises(Exception, match="blocked for 30 s"):
        drive.go(Leg(((2.0, 0.0),)), within=60)


@pytest.mark.parametrize("fault", [("bump", 1.0), ("slip", 0.3), ("bump", 2.5)])
def test_a_push_or_slip_on_the_way_is_made_good(fault):
    drive = Drive()
    follower = LegFollower(
        [Leg(((2.0, 0.0),), 0.0)], drive.pose, drive.pace, tolerance=0.1, holonomic=False, now=drive.now
    )
    began, pushed = drive.now, False
    while not follower.done:
        if drive.now - began > 2 and not pushed:
            pushed = True
            drive.board.set_fault(*fault)
        assert drive.now - began < 60
        drive.tell(drive.codec.motion(drive.kinematics.inverse(follower.step(drive.pose, drive.now))))
    assert drive.pose.position.x == pytest.approx(2.0, abs=0.12)
    assert abs(drive.pose.rotation.yaw) < 0.09


def test_a_holonomic_robot_goes_sideways_and_turns_on_its_way():
    x, y, yaw, now = 0.0, 0.0, 0.0, 0.0
    pose = Pose()
    follower = LegFollower(
        [Leg(((0.0, 2.0),), math.pi / 2)],
        pose,
        MotionLimits(0.5, 1.0),
        tolerance=0.1,
        holonomic=True,
        now=now,
    )
    first = None
    while not follower.done:
        assert now < 30
        velocity = follower.step(Pose(Vector3(x, y), quaternion_from_yaw(yaw)), now)
        first = first or (velocity if now > 0.3 else None)
        heading = math.atan2(velocity.linear.y, velocity.linear.x) + yaw
        x += velocity.linear.horizontal() * math.cos(heading) * PERIOD
        y += velocity.linear.horizontal() * math.sin(heading) * PERIOD
        yaw += velocity.yaw_rate * PERIOD
        now += PERIOD
    assert first.linear.y > 0.05
    assert (x, y) == pytest.approx((0.0, 2.0), abs=0.1)
    assert yaw == pytest.approx(math.pi / 2, abs=0.09)
