"""The bench of the contract tests: velocities by poses, and periodic calls that fail."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import LinkLost
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity, quaternion_from_yaw
from fleet.model.report import PoseReport
from fleet.testing.bench import FRESH, Bench
from fleet.testing.probes import near
from fleet.testing.robot import LoopRobot, RecordingRobot

FEEDBACK = 0.05  # s between two poses


class Idle:
    """An adapter that does nothing."""

    def __init__(self, robot):
        self.robot = robot

    async def connect(self):
        pass

    def connects(self):
        return True

    async def run(self):
        await self.robot.until(lambda: False)


def velocity_after(steps):
    """Return the velocity after feedbacks with these moves (ahead in m, turned in rad)."""
    robot = RecordingRobot()
    bench = Bench.__new__(Bench)
    bench.robot = robot
    x = y = yaw = 0.0
    for ahead, turned in steps:
        yaw += turned
        x, y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
        robot.report(PoseReport(robot.clock.time(), Vector3(x, y), quaternion_from_yaw(yaw)))
        robot.advance(FEEDBACK)
    return bench.velocity_by_poses()


def test_one_pose_is_no_velocity():
    assert velocity_after([(0.0, 0.0)]) is None


def test_old_poses_are_no_velocity():
    robot = RecordingRobot()
    bench = Bench.__new__(Bench)
    bench.robot = robot
    for x in (0.0, 0.1):
        robot.report(PoseReport(robot.clock.time(), Vector3(x), quaternion_from_yaw(0.0)))
        robot.advance(FRESH)
    robot.advance(FRESH / 10)
    assert bench.velocity_by_poses() is None


@given(speed=st.floats(-2.0, 2.0), yaw=st.floats(-3.0, 3.0))
def test_a_constant_velocity_is_found_in_the_frame_of_the_body(speed, yaw):
    found = velocity_after([(0.0, yaw)] + [(speed * FEEDBACK, 0.0)] * 10)
    assert found.linear.x == pytest.approx(speed, abs=1e-4)
    assert found.linear.y == pytest.approx(0.0, abs=1e-4)


def test_a_turn_is_found_across_half_a_turn():
    assert velocity_after([(0.0, 0.9 * FEEDBACK)] * 80).yaw_rate == pytest.approx(0.9, abs=1e-4)


def test_a_base_that_slows_down_has_the_velocity_of_its_last_moment():
    moves = [(0.5 * FEEDBACK, 0.0)] * 20 + [(0.0, 0.0)] * 7
    assert velocity_after(moves) == Velocity()


@given(rests=st.integers(1, 20))
def test_the_last_step_of_a_coarse_counter_is_no_motion(rests):
    """A counter of 1 cm can make its last step long after the base seemed to stand."""
    moves = [(0.0, 0.0)] * 20 + [(0.01, 0.0)] + [(0.0, 0.0)] * (rests - 1)
    assert near(velocity_after(moves), ZERO_VELOCITY)


def test_a_slow_drive_shows_through_a_coarse_counter():
    moves = [(0.01, 0.0), (0.0, 0.0)] * 20
    assert not near(velocity_after(moves), ZERO_VELOCITY)


async def test_the_exception_of_a_periodic_call_ends_the_calls_and_the_test():
    robot = LoopRobot()
    bench, made = Bench(Idle(robot), robot), []

    def fails():
        made.append(1)
        raise LinkLost("serial:/dev/ttyUSB0: closed")

    robot.every(0.001, fails)
    with pytest.raises(LinkLost, match="closed"):
        await bench.until(lambda: False, 60)
    assert made == [1]
    bench.life.cancel()
