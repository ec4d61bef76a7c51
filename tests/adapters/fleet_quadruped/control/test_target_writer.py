"""What the body wants, written to the drives: targets within the limits, everything else as it is."""

import math

import pytest

from fleet_quadruped.body.machine import BodyOutput, DriveAction
from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.control.target_writer import TargetWriter
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
STANCE = DOG.stance(0.27)
DT = DOG.dt


class Drives:
    """Drives that note what is written to them."""

    def __init__(self):
        self.log = []

    def __getattr__(self, name):
        return lambda *given: self.log.append((name, *given))


class Bench:
    def __init__(self):
        self.drives = Drives()
        self.writer = TargetWriter(DOG, self.drives)

    def write(self, action, angles=STANCE, *, at=STANCE, ages=0.0):
        ages = ages if isinstance(ages, tuple) else (ages,) * 12
        feedback = [JointFeedback(angle, age=age) for angle, age in zip(at, ages, strict=True)]
        joints = JointsFeedback.of(feedback)
        self.writer.write(BodyOutput(action, Targets(angles, ZEROS, ZEROS)), joints, DT)
        return self.drives.log[-1]


@pytest.fixture
def bench():
    bench = Bench()
    bench.write(DriveAction.REST)
    return bench


def moved(posture, joint, by):
    return tuple(angle + by * (number == joint) for number, angle in enumerate(posture))


@pytest.mark.parametrize(
    ("action", "written"),
    [
        (DriveAction.ENABLE, ("enable",)),
        (DriveAction.DAMP, ("damp", DOG.safety.kd)),
        (DriveAction.RESET, ("reset_fault",)),
        (DriveAction.REST, ("disable",)),
    ],
)
def test_what_is_no_target_is_passed_on_and_the_joints_are_where_they_are(bench, action, written):
    here = moved(STANCE, 4, 0.3)
    assert bench.write(action, at=here) == written
    assert bench.writer.last == here
    assert bench.writer.clamped == 0


def test_targets_are_held_as_they_are_if_they_are_near(bench):
    near = moved(STANCE, 2, 0.01)
    name, targets = bench.write(DriveAction.HOLD, near)
    assert (name, targets.angles) == ("write", near)
    assert (bench.writer.last, bench.writer.clamped) == (near, 0)


def test_a_target_that_is_far_is_approached_in_steps_and_counted(bench):
    far = moved(STANCE, 2, 0.3)
    step = min(DOG.safety.step, DOG.all_joints[2].kind.velocity * DT)
    for cycle in (1, 2):
        _, targets = bench.write(DriveAction.HOLD, far)
        assert targets.angles[2] == pytest.approx(STANCE[2] + min(cycle * step, 0.3))
        assert targets.angles[:2] == STANCE[:2]
    assert bench.writer.clamped == (2 if 2 * step < 0.3 else 1)


def test_a_target_that_is_no_number_keeps_the_last_one(bench):
    bench.write(DriveAction.HOLD, moved(STANCE, 2, 0.01))
    _, targets = bench.write(DriveAction.HOLD, moved(STANCE, 2, math.nan))
    assert targets.angles == moved(STANCE, 2, 0.01)


def test_after_drives_were_off_targets_begin_where_the_joints_are(bench):
    here = moved(STANCE, 2, -0.3)
    bench.write(DriveAction.DAMP, at=here)
    step = min(DOG.safety.step, DOG.all_joints[2].kind.velocity * DT)
    _, targets = bench.write(DriveAction.HOLD, STANCE, at=here)
    assert targets.angles[2] == pytest.approx(here[2] + step)


def test_a_dog_is_lowered_by_targets_and_with_the_damping_of_its_description(bench):
    name, targets, kd = bench.write(DriveAction.LOWER, moved(STANCE, 2, 0.01))
    assert (name, targets.angles, kd) == ("lower", moved(STANCE, 2, 0.01), DOG.safety.kd)


STALE = DOG.safety.stale_cycles * DT
AWAY = DOG.safety.following + 0.3  # rad


@pytest.mark.parametrize(("age", "silent"), [(STALE * 0.9, False), (STALE * 1.1, True), (math.inf, True)])
def test_while_it_is_lowered_a_silent_joint_counts_as_where_it_was_sent(bench, age, silent):
    """Else the distance to its last answer would pull its target back."""
    ages = tuple(age if number == 2 else 0.0 for number in range(12))
    _, targets, _ = bench.write(DriveAction.LOWER, STANCE, at=moved(STANCE, 2, AWAY), ages=ages)
    assert (targets.angles[2] == pytest.approx(STANCE[2])) is silent


def test_while_it_stands_the_last_answer_of_a_joint_counts_however_old(bench):
    _, targets = bench.write(DriveAction.HOLD, STANCE, at=moved(STANCE, 2, AWAY), ages=math.inf)
    assert targets.angles[2] > STANCE[2]
