"""All drives of a robot together: their feedback, joint by joint, and when all have answered."""

import math
from dataclasses import dataclass

import pytest

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.group import DriveGroup, ReportingDrive


@dataclass(slots=True)
class Drive(ReportingDrive):
    """A drive whose state a test sets."""

    said: tuple[Power, str] = (Power.ENABLED, "")

    def power(self, now):
        state, fault = self.said
        return state, fault and f"{fault} at {now:g}"


@pytest.fixture
def two(joint_of):
    drives = [Drive(joint_of("FL_hip", number=2)), Drive(joint_of("FL_knee", number=3))]
    return drives, DriveGroup(None, {}, drives)


def test_a_drive_that_never_answered_is_infinitely_old_and_tells_nothing(two):
    _, group = two
    feedback = group.feedback(5.0)
    assert feedback.ages == (math.inf, math.inf)
    assert feedback.angles == (0.0, 0.0)
    assert feedback.temperatures == feedback.voltages == (None, None)


def test_the_feedback_of_each_joint_is_that_of_its_drive(two):
    drives, group = two
    hip, knee = drives
    hip.angle, hip.speed, hip.torque, hip.reported_at = 0.1, 0.2, 0.3, 4.0
    hip.temperature, hip.voltage = 45.0, 24.0
    knee.angle, knee.reported_at, knee.restarted, knee.said = -0.5, 4.75, True, (Power.FAULT, "hot")
    first, second = group.feedback(5.0).each()
    assert (first.angle, first.speed, first.torque) == (0.1, 0.2, 0.3)
    assert (first.power, first.age) == (Power.ENABLED, 1.0)
    assert (first.temperature, first.voltage, first.restarted, first.fault) == (45.0, 24.0, False, "")
    assert (second.angle, second.age, second.restarted) == (-0.5, 0.25, True)
    assert (second.power, second.fault) == (Power.FAULT, "hot at 5")


def test_a_cycle_is_complete_once_each_drive_has_answered_in_it(two):
    drives, group = two
    assert not group.complete()
    for drive in drives:
        assert not group.complete()
        drive.answers.add(b"here")
    assert group.complete()
    group.begin_cycle(0.01)
    assert not group.complete()


def test_two_answers_in_cycle_after_cycle_are_of_two_drives_with_one_id(two):
    drives, group = two
    for _ in range(5):
        drives[0].answers.add(b"one")
        drives[0].answers.add(b"other")
        drives[1].answers.add(b"one")
        group.begin_cycle(0.01)
    assert [drive.answers.doubled for drive in drives] == [True, False]
    assert drives[0].duplicate_id_fault == "two drives answer as id 2 on bus a: give each its own"


def test_a_protocol_without_problems_and_shared_frames_of_its_own_has_none(dog):
    assert (DriveGroup.problems(dog), DriveGroup.shared(dog)) == ([], ())
