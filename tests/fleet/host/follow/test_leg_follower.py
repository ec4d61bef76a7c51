"""An ideal robot is led along legs in lock-step: it arrives, keeps to its limits, gives up when blocked."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import TimedOut
from fleet.host.follow.leg_follower import GIVE_UP, HOLD, REST, TOLERANCE, FollowPhase, LegFollower
from fleet.host.follow.legs import Leg
from fleet.host.follow.motion_laws import MotionLimits
from fleet.model.geometry import (
    ZERO_VELOCITY,
    Pose,
    Vector3,
    quaternion_from_euler,
    rotate_to_world,
    wrap_angle,
)

PERIOD = 0.05  # s
PACE = MotionLimits(speed=0.8, yaw_rate=1.2)
coordinates = st.floats(-3, 3)
angles = st.floats(-3.1, 3.1)


class Robot:
    """A robot that does exactly what it is told, unless it is ``held``; led with the time of its own."""

    def __init__(self, *legs, pose=(0.0, 0.0, 0.0), holonomic=False, tolerance=TOLERANCE):
        self.x, self.y, self.yaw = pose
        self.now = 50.0
        self.held = False
        self.velocities, self.phases, self.reports = [], [], []
        self.follower = LegFollower(
            legs, self.pose, PACE, tolerance=tolerance, holonomic=holonomic, now=self.now
        )

    @property
    def pose(self):
        return Pose(Vector3(self.x, self.y), quaternion_from_euler(0.0, 0.0, self.yaw))

    def step(self):
        velocity = self.follower.step(self.pose, self.now)
        self.velocities.append(velocity)
        self.phases.append(self.follower.phase)
        self.reports.append(self.follower.progress())
        if not self.held:
            moved = rotate_to_world(velocity.linear, self.yaw)
            self.x, self.y = self.x + moved.x * PERIOD, self.y + moved.y * PERIOD
            self.yaw = wrap_angle(self.yaw + velocity.yaw_rate * PERIOD)
        self.now += PERIOD
        return velocity

    def arrive(self, within=120.0):
        end = self.now + within
        while not self.follower.done:
            assert self.now < end, (self.follower.phase, self.pose)
            self.step()
        return self

    def until(self, phase, within=120.0):
        end = self.now + within
        while self.follower.phase is not phase:
            assert self.now < end, (self.follower.phase, self.pose)
            self.step()
        return self

    def away(self, x, y):
        return math.hypot(self.x - x, self.y - y)

    @property
    def sequence(self):
        """The phases that it went through."""
        return [str(phase) for phase, _ in itertools.groupby(self.phases)]


@settings(max_examples=25)
@given(x=coordinates, y=coordinates, yaw=st.none() | angles, start=angles, holonomic=st.booleans())
def test_every_goal_is_reached_within_the_tolerance_and_with_its_heading(x, y, yaw, start, holonomic):
    robot = Robot(Leg(((x, y),), yaw), pose=(0.0, 0.0, start), holonomic=holonomic).arrive()
    assert robot.away(x, y) <= TOLERANCE
    assert yaw is None or abs(wrap_angle(robot.yaw - yaw)) < 0.07
    assert robot.velocities[-1] == ZERO_VELOCITY


@settings(max_examples=15)
@given(points=st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=4), holonomic=st.booleans())
def test_no_velocity_is_faster_or_begins_more_suddenly_than_the_limits(points, holonomic):
    robot = Robot(Leg(tuple(points)), holonomic=holonomic).arrive()
    for before, velocity in itertools.pairwise([ZERO_VELOCITY, *robot.velocities]):
        assert velocity.linear.norm() <= PACE.speed + 1e-9
        assert abs(velocity.yaw_rate) <= PACE.yaw_rate + 1e-9
        if not velocity.is_zero:
            assert (velocity.linear - before.linear).norm() <= PACE.acceleration * PERIOD + 1e-9
            assert abs(velocity.yaw_rate - before.yaw_rate) <= PACE.yaw_acceleration * PERIOD + 1e-9
    percents = [report.percent for report in robot.reports]
    assert percents == sorted(percents)
    assert percents[-1] == 99.0, "the whole is said only by its end"
    assert robot.reports[-1].reached == len(points)


def test_a_robot_turns_drives_aligns_and_stands():
    robot = Robot(Leg(((0.0, 2.0),), 0.0)).arrive()
    assert robot.sequence == ["turn", "drive", "align", "hold", "done"]
    for velocity, phase in zip(robot.velocities, robot.phases, strict=True):
        assert velocity.linear.norm() == 0 or phase in (FollowPhase.DRIVE, FollowPhase.ALIGN)


def test_one_that_moves_any_way_does_not_turn_first():
    robot = Robot(Leg(((0.0, 2.0),)), holonomic=True).arrive()
    assert abs(robot.yaw) < 0.01
    assert abs(robot.x) < TOLERANCE


def test_a_leg_in_reverse_is_driven_backwards():
    robot = Robot(Leg(((-2.0, 0.0),), backwards=True)).arrive()
    assert abs(robot.yaw) < 0.1
    assert min(velocity.linear.x for velocity in robot.velocities) < -0.5


def test_the_points_of_a_path_are_passed_in_order_and_counted_over_legs():
    legs = Leg(((1.0, 0.0), (2.0, 0.0)), 0.0), Leg(((2.0, 1.0),), wait=1.0), Leg(((2.0, 2.0),))
    robot = Robot(*legs).arrive()
    reached = [report.reached for report in robot.reports]
    assert reached == sorted(reached)
    assert set(reached) == {0, 1, 2, 3, 4}
    assert robot.away(2.0, 2.0) <= TOLERANCE
    lefts = [report.remaining for report in robot.reports]
    assert lefts[0] == pytest.approx(4.0, abs=0.1)
    assert lefts[-1] == 0.0


@pytest.mark.parametrize("wait", [0.0, 3.0])
def test_it_stands_at_a_goal_for_a_moment_and_for_the_wait(wait):
    robot = Robot(Leg(((1.0, 0.0),), wait=wait)).until(FollowPhase.HOLD)
    since = robot.now
    robot.arrive()
    assert robot.now - since == pytest.approx(HOLD + wait, abs=3 * PERIOD)


def test_one_that_drifts_from_its_goal_while_it_stands_returns_to_it():
    robot = Robot(Leg(((1.0, 0.0),), 0.0, wait=5.0)).until(FollowPhase.HOLD)
    robot.x += 0.5
    robot.step()
    assert robot.follower.phase is FollowPhase.TURN
    robot.until(FollowPhase.HOLD)
    assert robot.away(1.0, 0.0) <= TOLERANCE
    robot.yaw += 0.2
    robot.step()
    assert robot.follower.phase is FollowPhase.ALIGN
    robot.arrive()
    assert abs(robot.yaw) < 0.07


def test_one_that_is_turned_away_from_its_path_turns_on_the_spot():
    robot = Robot(Leg(((5.0, 0.0),))).until(FollowPhase.DRIVE)
    robot.yaw = 1.5
    robot.step()
    assert robot.follower.phase is FollowPhase.TURN
    robot.arrive()


@pytest.mark.parametrize(("tolerance", "kept"), [(0.001, 0.05), (0.3, 0.3), (50.0, 2.0)])
def test_a_tolerance_is_kept_between_what_is_possible_and_what_is_sensible(tolerance, kept):
    robot = Robot(Leg(((6.0, 0.0),), wait=5.0), tolerance=tolerance).until(FollowPhase.HOLD)
    assert robot.away(6.0, 0.0) <= min(kept, 0.25)
    robot.x = 6.0 + kept - 0.01
    robot.step()
    assert robot.follower.phase is FollowPhase.HOLD
    robot.x = 6.0 + kept + 0.01
    robot.step()
    assert robot.follower.phase is FollowPhase.TURN


def test_one_that_is_blocked_stands_tries_again_and_goes_on_once_it_is_free():
    robot = Robot(Leg(((3.0, 0.0),))).until(FollowPhase.DRIVE)
    robot.held = True
    robot.until(FollowPhase.BLOCKED)
    assert (robot.reports[-1].blocked, robot.reports[-1].message) == (
        True,
        "blocked: it is commanded and does not get on",
    )
    since = robot.now
    assert robot.step() == ZERO_VELOCITY
    robot.until(FollowPhase.TURN)
    assert robot.now - since == pytest.approx(REST, abs=3 * PERIOD)
    assert not robot.reports[-1].blocked
    robot.held = False
    robot.arrive()


def test_one_that_stays_blocked_is_given_up():
    robot = Robot(Leg(((3.0, 0.0),)))
    robot.held = True
    with pytest.raises(TimedOut, match=rf"blocked for {GIVE_UP:g} s with 3\.00 m to go"):
        robot.arrive()
    assert robot.now - 50.0 == pytest.approx(GIVE_UP + 6.0, abs=3.5)


def test_one_that_gets_on_between_its_blocks_is_not_given_up():
    robot = Robot(Leg(((8.0, 0.0),)))
    for _ in range(8):
        robot.held = True
        robot.until(FollowPhase.BLOCKED)
        robot.held = False
        for _ in range(80):
            robot.step()
    robot.held = False
    robot.arrive()


def test_a_gap_between_poses_makes_no_jump_of_speed():
    robot = Robot(Leg(((5.0, 0.0),))).until(FollowPhase.DRIVE)
    robot.now += 60.0
    assert robot.step().linear.norm() <= PACE.acceleration * 0.5
    robot.now -= 30.0
    before = robot.velocities[-1]
    assert robot.step().linear.norm() <= before.linear.norm()


def test_after_its_end_it_stands():
    robot = Robot(Leg(((1.0, 0.0),))).arrive()
    robot.x = 0.0
    assert [robot.step() for _ in range(20)] == [ZERO_VELOCITY] * 20


@pytest.mark.parametrize(("past", "there"), [(0.08, True), (0.095, False)])
def test_one_that_has_gone_a_little_past_its_goal_does_not_turn_back_for_it(past, there):
    robot = Robot(Leg(((2.0, 0.0),), 0.0)).until(FollowPhase.DRIVE)
    while robot.x < 1.9:
        robot.step()
    robot.x = 2.0 + past
    robot.step()
    assert (robot.follower.phase is FollowPhase.ALIGN) is there
