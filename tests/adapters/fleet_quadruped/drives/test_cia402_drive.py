"""What a CiA 402 drive's answers mean when they come late."""

import pytest

from fleet_quadruped.can.frame import Frame
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.cia402.frames import TPDO1, Units
from fleet_quadruped.sim.lockstep import SimBus


@pytest.fixture
def drives(dog):
    return drives_of(dog, {"a": SimBus("a")})


def answer(dog, angle):
    joint = dog.all_joints[0]
    return Frame(TPDO1 + joint.id, Units(joint).pack(0x1237, angle, 0.0))


@pytest.mark.parametrize("late", [0.0, 0.004, 0.007, 0.0095])
def test_an_answer_that_is_late_makes_no_joint_seem_fast(dog, drives, late):
    """At 2 rad/s, one of the answers comes just before the next."""
    for cycle in range(10):
        now = 10.0 + cycle * dog.dt + (late if cycle == 5 else 0.0)
        drives.take("a", answer(dog, 0.02 * cycle), now)
        assert cycle == 0 or 0.9 < drives.feedback(now).speeds[0] < 3.5
    assert drives.feedback(now).speeds[0] == pytest.approx(2.0, abs=0.02)
