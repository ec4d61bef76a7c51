"""The dog in physics: what it reaches, and what it survives."""

import math
import random

import msgspec
import pytest

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import standing_in_physics
from tests.adapters.fleet_quadruped.kinds import on_stiff_and_soft
from tests.tools.wander import wander


@pytest.fixture
def walker(any_dog):
    return standing_in_physics(any_dog)


def speed(rig, twist, seconds=2.0):
    """Return the true speed (m/s) and turn (rad/s) once the velocity is reached."""
    rig.go(1.5, twist)
    start, heading = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    rig.go(seconds, twist)
    end, turned = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    return math.dist(start[:2], end[:2]) / seconds, math.remainder(turned - heading, math.tau) / seconds


def test_it_walks_forward_sideways_and_turns_at_the_speed_it_is_given(walker):
    walker.go(1.5, Twist(0.6))
    before, start = walker.state(), walker.sim.world.place()
    walker.go(2.0, Twist(0.6))
    after, end = walker.state(), walker.sim.world.place()
    true = math.dist(start[:2], end[:2])
    assert true / 2.0 == pytest.approx(0.6, rel=0.1)
    assert math.dist((before.x, before.y), (after.x, after.y)) == pytest.approx(true, rel=0.1), "odometry"
    assert math.degrees(walker.tilt) < 5
    assert speed(walker, Twist(0, 0.2))[0] == pytest.approx(0.2, rel=0.1)
    assert speed(walker, Twist(0, 0, 0.8), 1.5)[1] == pytest.approx(0.8, rel=0.1)
    assert math.degrees(walker.tilt) < 5
    assert walker.fault == ""


@on_stiff_and_soft
def test_the_gait_walk_is_slow_and_keeps_three_feet_on_the_ground(walker):
    walker.order = msgspec.structs.replace(walker.order, gait="walk")
    fewest = []
    walker.watch = lambda: fewest.append(sum(walker.controller.body.walker._steps.stance))
    assert speed(walker, Twist(0.6), 2.8)[0] == pytest.approx(0.15, rel=0.1)
    assert math.degrees(walker.tilt) < 5
    assert min(fewest) == 3
    walker.order = msgspec.structs.replace(walker.order, gait="trot")
    end = walker.sim.time + 4.5
    while walker.controller.body.walker.odometry.twist.x < 0.3 and walker.sim.time < end:
        walker.go(0.1, Twist(0.4))
    walker.go(0.5, Twist(0.4))
    assert walker.mode is BodyMode.WALKING
    assert walker.controller.body.walker.odometry.twist.x > 0.3
    assert walker.fault == ""


@pytest.mark.combinations
@pytest.mark.parametrize("gait", ["trot", "walk"])
def test_no_sequence_of_allowed_velocities_makes_it_fall(walker, gait, request):
    seconds = 40.0 if request.config.getoption("--soak") else 16.0
    tilt = wander(walker, gait, random.Random(gait), seconds)
    assert walker.fault == ""
    soft = walker.dog.drive.protocol == "moteus"  # its kd is bound to kp: it follows less stiffly
    assert math.degrees(tilt) < (18 if soft else 9)


def test_five_percent_of_lost_frames_do_not_make_it_fall(walker):
    walker.sim.fault("loss", 0.05)
    walker.go(5.0, Twist(0.6))
    assert (walker.mode, walker.fault) == (BodyMode.WALKING, "")


@pytest.mark.combinations
@pytest.mark.parametrize("twist", [Twist(-0.3), Twist(0.4, 0.0, 0.5)])
def test_it_stays_up_on_ice_and_with_late_frames(any_dog, twist):
    rig = Rig(any_dog, MujocoWorld(any_dog, friction=0.4))
    rig.stand()
    rig.sim.fault("delay", 0.01)  # a cycle, each way
    rig.go(3.0, twist)
    assert (rig.mode, rig.fault) == (BodyMode.WALKING, "")
    assert math.degrees(rig.tilt) < 8


@pytest.mark.combinations
@pytest.mark.parametrize("twist", [Twist(0.5), Twist(0.8, 0.0, 1.0)])
@pytest.mark.parametrize("phase", [0.0, 0.1, 0.2, 0.3])
def test_an_emergency_stop_lowers_it_gently(walker, phase, twist):
    walker.go(1.5 + phase, twist)
    drops, nearest = [], []
    walker.watch = lambda: (drops.append(walker.sim.world.fall_speed), nearest.append(room(walker)))
    walker.emergency()
    walker.go(0.1, until=BodyMode.DAMPED)
    walker.go(2.5, until=BodyMode.OFF)
    walker.go(0.2)
    assert max(drops) < 0.5
    assert min(nearest) > 0.0
    assert walker.mode is BodyMode.OFF
    assert walker.sim.world.place()[2] < 0.15


def room(rig):
    """Return how far the joint that is nearest to the end of its travel has still to go, rad."""
    both = zip(rig.dog.all_joints, rig.sim.world.motors, strict=True)
    return min(min(motor.angle - joint.low, joint.high - motor.angle) for joint, motor in both)


def test_a_push_that_throws_it_over_is_noticed(walker):
    walker.sim.world.push((0.0, 400.0, 100.0))
    walker.go(0.6)
    walker.sim.world.push((0.0, 0.0, 0.0))
    walker.go(0.5)
    assert walker.mode is BodyMode.DAMPED
    assert walker.fault.startswith("imu: tilted")


@pytest.mark.combinations
@pytest.mark.parametrize(("phase", "friction"), [(0.0, 0.6), (0.1, 0.8), (0.2, 1.0), (0.3, 0.7)])
def test_no_joint_leaves_its_limits_when_the_controller_dies_in_mid_trot(
    any_dog, phase, friction, stopped_alone
):
    rig = Rig(any_dog, MujocoWorld(any_dog, friction=friction))
    rig.stand()
    rig.go(1.5 + phase, Twist(0.5))
    for _ in range(500):
        rig.sim.advance(0.002)
        for joint, motor in zip(any_dog.all_joints, rig.sim.world.motors, strict=True):
            assert joint.low <= motor.angle <= joint.high, joint.name
    assert stopped_alone(rig)


def test_drives_without_a_torque_offset_walk_too(dog):
    rig = Rig(dog, MujocoWorld(dog))
    for drive in rig.sim.drives:
        drive.sdo.be_plain()
    rig.controller.drives.configure()
    rig.stand()
    assert speed(rig, Twist(0.5))[0] == pytest.approx(0.5, rel=0.1)
    assert math.degrees(rig.tilt) < 6
    assert rig.state().torques == (0.0,) * 12
