"""What a CiA 402 drive's answers mean when they come late, and when it has stopped or left by itself."""

import pytest

from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402.frames import EMERGENCY, HEARTBEAT, TPDO1, CountUnits
from fleet_quadruped.sim.lockstep import SimBus


@pytest.fixture
def drives(dog):
    bus = SimBus("a")
    bus.connect(Deaf())
    return drives_of(dog, {"a": bus})


class Deaf:
    """A dog that takes frames and says nothing."""

    def handle_frame(self, bus, frame):
        """Take a frame."""


def answer(dog, angle):
    joint = dog.all_joints[0]
    return CanFrame(TPDO1 + joint.id, CountUnits(joint).pack(0x1237, angle, 0.0))


@pytest.mark.parametrize("late", [0.0, 0.004, 0.007, 0.0095])
def test_an_answer_that_is_late_makes_no_joint_seem_fast(dog, drives, late):
    """At 2 rad/s, one of the answers comes just before the next."""
    for cycle in range(10):
        now = 10.0 + cycle * dog.dt + (late if cycle == 5 else 0.0)
        drives.handle_frame("a", answer(dog, 0.02 * cycle), now)
        assert cycle == 0 or 0.9 < drives.feedback(now).speeds[0] < 3.5
    assert drives.feedback(now).speeds[0] == pytest.approx(2.0, abs=0.02)


def test_a_drive_that_missed_our_heartbeat_is_not_taken_for_enabled(dog, drives):
    """Drives go on from their stop by the next control word that says enabled."""
    drives.handle_frame("a", answer(dog, 0.0), 10.0)
    drives.handle_frame("a", CanFrame(EMERGENCY + 1, bytes.fromhex("3081110000000000")), 10.0)
    feedback = drives.feedback(10.0)
    assert feedback.powers[0] is Power.STOPPING
    assert feedback.faults[0] == "our heartbeat did not reach the drive (emergency 8130h, register 11h)"


@pytest.mark.parametrize(("state", "restarts"), [(0x7F, True), (0x04, True), (0x05, False)])
def test_a_drive_that_has_left_operation_is_reported_and_started_again(dog, drives, state, restarts):
    drives.handle_frame("a", answer(dog, 0.0), 10.0)
    drives.handle_frame("a", CanFrame(HEARTBEAT + 1, bytes([state])), 10.0)
    feedback = drives.feedback(10.0)
    assert (feedback.powers[0] is Power.STOPPING) == restarts
    assert feedback.faults[0] == (f"id 1 has left operation (heartbeat {state:02X}h)" if restarts else "")
    drives.begin_cycle(10.01)
    started = CanFrame(0x000, b"\x01\x01") in drives._buses["a"].sent
    assert started == restarts


def test_a_drive_that_has_restarted_is_not_started_again_without_being_configured(dog, drives):
    for state in (0x05, 0x00, 0x7F):
        drives.handle_frame("a", CanFrame(HEARTBEAT + 1, bytes([state])), 10.0)
    drives.begin_cycle(10.01)
    assert not [frame for frame in drives._buses["a"].sent if frame.id == 0x000]
