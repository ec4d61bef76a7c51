import pytest

from fleet import Quaternion
from fleet_quadruped.robot.description import leg_angles
from fleet_quadruped.sim.mujoco_world import MujocoWorld


def sent(dog, **changes):
    """Return the angles of a dog in the air whose joints were sent to a stance with these changes."""
    world = MujocoWorld(dog)
    world.put(Quaternion(), 3.0)
    names = [joint.name for joint in dog.all_joints]
    for name, motor, angle in zip(names, world.motors, dog.stance(dog.gait.height), strict=True):
        motor.kp, motor.kd, motor.target = 40.0, 2.0, changes.get(name, angle)
    world.step(0.5)
    world.measure()
    return tuple(motor.angle for motor in world.motors)


def foot(dog, posture, leg):
    shape = dog.legs[leg]
    x, y, z = shape.foot(leg_angles(posture, leg))
    return shape.x + x, shape.y + y, z


def test_a_leg_does_not_pass_through_another(dog):
    posture = sent(dog, FL_abad=-0.8, FR_abad=0.8)
    left, right = foot(dog, posture, 0), foot(dog, posture, 1)
    assert left[1] > right[1]


def test_a_leg_that_meets_nothing_goes_where_it_is_sent(dog):
    posture = sent(dog, FL_abad=0.6)
    assert posture[0] == pytest.approx(0.6, abs=0.05)
