"""The world without an engine: joints that follow with a lag, and a body that stands on its lowest feet."""

import math

import pytest

from fleet_quadruped.robot.description import EXAMPLE, leg_angles, load_description
from fleet_quadruped.sim.world import KinematicWorld

DOG = load_description(EXAMPLE)
LAG, DT = 0.01, 0.01


@pytest.fixture
def world():
    return KinematicWorld(DOG)


def lead(world, posture, seconds=0.2):
    """Lead all joints to a posture, and let time pass."""
    for motor, angle in zip(world.motors, posture, strict=True):
        motor.kp, motor.target = 100.0, angle
    for _ in range(round(seconds / DT)):
        world.step(DT)
        world.measure()
    return world


def shifted(x=0.0, y=0.0, turn=0.0, lift=(), height=0.27):
    """Return the posture whose feet are moved on the ground; the legs ``lift`` are off it."""
    angles = []
    for number, leg in enumerate(DOG.legs):
        foot = leg.foot(leg_angles(DOG.stance(height), number))
        at_x, at_y = leg.x + foot[0], leg.y + foot[1]
        turned = (
            at_x * math.cos(turn) - at_y * math.sin(turn),
            at_x * math.sin(turn) + at_y * math.cos(turn),
        )
        place = (turned[0] + x - leg.x, turned[1] + y - leg.y, foot[2] + 0.05 * (number in lift))
        angles += leg.angles(place)
    return tuple(angles)


def test_it_lies_folded_and_limp_at_first(world):
    assert [motor.angle for motor in world.motors] == list(DOG.posture(DOG.poses.fold))
    assert {motor.kp for motor in world.motors} == {0.0}
    assert world.place()[:2] == (0.0, 0.0)


def test_a_limp_joint_stays_where_it_is_without_torque(world):
    motor = world.motors[2]
    motor.target, motor.feed = -1.0, 5.0
    before = motor.angle
    world.step(DT)
    assert (motor.angle, motor.speed, motor.torque) == (before, 0.0, 0.0)


def test_a_joint_follows_its_target_with_its_lag(world):
    motor = world.motors[2]
    motor.kp, motor.target, motor.feed = 100.0, motor.angle + 0.1, 5.0
    before = motor.angle
    world.step(LAG)
    assert motor.angle - before == pytest.approx(0.1 * (1 - 1 / math.e))
    assert motor.speed == pytest.approx((motor.angle - before) / LAG)
    assert motor.torque == 5.0


def test_a_joint_is_no_faster_than_its_kind(world):
    motor, fastest = world.motors[2], DOG.all_joints[2].kind.velocity
    motor.kp, motor.target = 100.0, motor.angle + 2.0
    before = motor.angle
    world.step(DT)
    assert motor.angle - before == pytest.approx(fastest * DT)
    motor.target = before - 2.0
    world.step(DT)
    assert motor.speed == pytest.approx(-fastest)


def test_a_target_moves_by_its_slope(world):
    motor = world.motors[2]
    motor.kp, motor.slope = 100.0, 2.0
    before = motor.target
    for _ in range(5):
        world.step(DT)
    assert motor.target == pytest.approx(before + 0.1)


@pytest.mark.parametrize("height", [0.2, 0.3])
def test_the_body_is_as_high_as_its_lowest_feet_hold_it(world, height):
    assert lead(world, DOG.stance(height)).place()[2] == pytest.approx(height, abs=0.001)
    assert lead(world, shifted(lift={0, 3}, height=height)).place()[2] == pytest.approx(height, abs=0.001)


@pytest.mark.parametrize(("x", "y"), [(0.05, 0.0), (-0.05, 0.0), (0.0, 0.04)])
def test_the_body_moves_against_its_standing_feet(world, x, y):
    lead(world, DOG.stance(0.27))
    start = world.place()
    end = lead(world, shifted(x, y)).place()
    assert (end[0] - start[0], end[1] - start[1]) == pytest.approx((-x, -y), abs=0.002)
    assert world.imu().rotation.yaw == pytest.approx(0.0, abs=0.01)


def test_feet_in_the_air_do_not_move_the_body(world):
    lead(world, shifted(lift={0, 3}))
    start = world.place()
    posture = (*shifted(0.05, lift={0, 3})[:3], *shifted(lift={0, 3})[3:9], *shifted(0.05, lift={0, 3})[9:])
    assert lead(world, posture).place() == pytest.approx(start, abs=0.002)


def test_the_body_turns_against_its_feet(world):
    lead(world, DOG.stance(0.27))
    lead(world, shifted(turn=-0.2))
    assert world.imu().rotation.yaw == pytest.approx(0.2, abs=0.005)


def test_the_body_moves_along_its_heading(world):
    lead(world, DOG.stance(0.27))
    start = world.place()
    world._yaw = math.pi / 2
    end = lead(world, shifted(-0.05, -0.02)).place()
    assert (end[0] - start[0], end[1] - start[1]) == pytest.approx((-0.02, 0.05), abs=0.003)


def test_the_imu_has_the_rate_of_the_turn_and_a_level_body(world):
    lead(world, DOG.stance(0.27))
    for motor, angle in zip(world.motors, shifted(turn=-0.01), strict=True):
        motor.target = angle
    world.step(DT)
    world.measure()
    imu = world.imu()
    assert imu.gyro.z == pytest.approx(0.01 * (1 - 1 / math.e) / DT, rel=0.05)
    assert (imu.tilt, imu.accel.z, imu.gyro.x) == (pytest.approx(0.0, abs=1e-6), 9.81, 0.0)


def test_a_measurement_covers_all_steps_since_the_last_one(world):
    lead(world, DOG.stance(0.27))
    start = world.place()
    for motor, angle in zip(world.motors, shifted(0.02), strict=True):
        motor.target = angle
    for _ in range(20):
        world.step(DT)
    assert world.place()[:2] == start[:2]
    world.measure()
    world.measure()  # nothing has passed: nothing changes
    assert world.place()[0] - start[0] == pytest.approx(-0.02, abs=0.002)
