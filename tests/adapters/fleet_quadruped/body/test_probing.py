import pytest

from fleet_quadruped.body.probing import lean_angles, lean_tests, look_times, probing_motion
from fleet_quadruped.robot.description import leg_angles


def test_all_postures_are_within_the_limits(dog):
    for lean in lean_tests(dog):
        for joint, angle in zip(dog.all_joints, lean_angles(dog, lean), strict=True):
            assert joint.low + dog.safety.margin < angle < joint.high - dog.safety.margin, lean


def test_crouching_level_the_feet_are_below_the_hips(dog):
    posture = lean_angles(dog, lean_tests(dog)[0])
    for number, leg in enumerate(dog.legs):
        foot = leg.foot(leg_angles(posture, number))
        down = dog.geometry.foot_radius - dog.gait.lowest
        assert foot == pytest.approx((0.0, leg.side * leg.offset, down), abs=1e-6)


def test_each_look_is_at_the_end_of_a_pause(dog):
    motion = probing_motion(dog, dog.posture(dog.poses.fold))
    last = 0.0
    for lean, at in zip(lean_tests(dog), look_times(dog), strict=True):
        while last < at - 0.015:
            targets = motion.step(0.01)
            last += 0.01
        assert targets.angles == pytest.approx(lean_angles(dog, lean), abs=1e-6)
        assert max(map(abs, targets.speeds)) < 1e-6
