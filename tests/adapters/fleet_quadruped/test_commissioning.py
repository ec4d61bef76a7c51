"""Signs and offsets, found by small moves in physics. All twelve joints, and fifty right dogs: the bench."""

import pytest

from fleet import Quaternion
from fleet.model.geometry import quaternion_from_euler
from fleet_quadruped.body.probing import lean_angles, lean_tests
from fleet_quadruped.commissioning import Observation, at_rest, problems
from fleet_quadruped.robot.names import JOINTS
from tests.tools.planted import as_built, checked, with_offset, with_sign


def seen(dog):
    """Return what is seen of a dog that moves as it is told, exactly."""
    return [
        Observation(lean_angles(dog, lean), quaternion_from_euler(lean.roll, lean.pitch, lean.yaw))
        for lean in lean_tests(dog)
    ]


def shifted(look, joint, offset):
    angles = tuple(angle + offset * (number == joint) for number, angle in enumerate(look.angles))
    return look._replace(angles=angles)


@pytest.mark.parametrize("protocol", ["cia402", "moteus"])  # stiff and soft; the others are stiff, too
def test_a_right_dog_with_the_errors_of_manufacturing_is_right(dogs, protocol):
    assert checked(dogs[protocol], *as_built(dogs[protocol], 1)) == []


@pytest.mark.parametrize(("name", "offset"), [("RL_abad", -0.11), ("RR_knee", 0.11)])
def test_a_wrong_offset_is_found_by_its_joint(dog, name, offset):
    found = checked(with_offset(dog, name, offset), *as_built(dog, 2))
    assert [line.partition(":")[0] for line in found] == [name]


@pytest.mark.combinations
@pytest.mark.parametrize("calibrated", [True, False])
@pytest.mark.parametrize("name", ["FL_abad", "RR_hip", "FR_knee"])
def test_a_wrong_sign_is_found(dog, name, calibrated):
    assert checked(with_sign(dog, name, calibrated=calibrated), *as_built(dog, 3))


@pytest.mark.parametrize("joint", [0, 4, 11], ids=lambda joint: JOINTS[joint])  # one of each kind
def test_the_joint_and_its_offset_are_reported(dog, joint):
    looks = [shifted(look, joint, 0.15) for look in seen(dog)]
    (line,) = problems(dog, looks)
    name = JOINTS[joint]
    offset = float(line.partition("most likely its offset is ")[2].split()[0])
    assert line.startswith(f"{name}: ")
    assert offset == pytest.approx(dog.joints[name].offset + dog.joints[name].sign * 0.15, abs=0.05)


@pytest.mark.parametrize("joint", range(len(JOINTS)))
def test_lying_folded_a_joint_far_from_the_fold_is_reported(dog, joint):
    fold = dog.posture(dog.poses.fold)
    assert at_rest(dog, fold) == []
    assert at_rest(dog, shifted(Observation(fold, Quaternion()), joint, 1.0).angles)[0].startswith(
        JOINTS[joint]
    )


def test_a_check_that_ends_before_anything_is_seen_says_why(dog):
    assert problems(dog, [], "a bus is gone") == ["the moves ended early: a bus is gone"]
