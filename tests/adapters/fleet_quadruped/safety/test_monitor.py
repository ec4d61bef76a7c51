import pytest

from fleet import Quaternion, Vector3
from fleet.model.geometry import quaternion_from_euler
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback, Power
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.monitor import Monitor, ObservedCycle
from fleet_quadruped.safety.stages import BodyMode, StopStage

LEVEL = MeasuredImu(Quaternion(), Vector3(), Vector3(0, 0, 9.81))


@pytest.fixture
def look(dog):
    """Look at a walking dog of which some things are different; return the trip."""
    monitor, stance = Monitor(dog), dog.stance(0.27)

    def check(joint="FL_hip", change=None, cycles=1, **changes):
        feedback = [JointFeedback(angle, power=Power.ENABLED, age=0.0) for angle in stance]
        number = JOINTS.index(joint)
        feedback[number] = feedback[number]._replace(**(change or {}))
        plain = {"imu": LEVEL, "targets": stance, "imu_age": 0.0, "battery": 80.0, "mode": BodyMode.WALKING}
        seen = ObservedCycle(joints=JointsFeedback.of(feedback), dt=0.01, **(plain | changes))
        return [monitor.check(seen) for _ in range(cycles)][-1]

    return check


def test_a_healthy_dog_walks_on(look):
    assert look(cycles=25) is None


def test_a_fault_of_a_drive_damps_and_names_it(look):
    trip = look("RR_knee", {"power": Power.FAULT, "fault": "over-current"})
    assert trip == (StopStage.DAMP, "RR_knee: over-current")


def test_a_drive_that_lets_go_damps(look):
    assert look(change={"power": Power.DISABLED}).cause == "FL_hip: wanted enabled, the drive is disabled"


def test_one_silent_joint_is_waited_for_and_then_damps(look):
    assert look(change={"age": 0.08}) is None
    assert look(change={"age": 0.2}).cause == "FL_hip: no feedback from id 2 on bus a for 0.20 s"


def test_a_joint_that_does_not_follow_damps_after_a_while(look):
    assert look(change={"angle": 1.3}, cycles=9) is None
    trip = look(change={"angle": 1.3}, cycles=5)
    assert trip == (StopStage.DAMP, "FL_hip: following error, wanted 0.89 rad, is at 1.30")


def test_a_joint_outside_its_limits_points_at_sign_and_offset(look):
    assert "check its sign and offset" in look("FL_knee", {"angle": 1.8}).cause


def test_a_tilted_dog_is_damped(look):
    tilted = LEVEL._replace(rotation=quaternion_from_euler(0.9, 0, 0))
    assert look(imu=tilted).cause == "imu: tilted 0.90 rad, more than 0.785"


def test_a_dog_that_rolls_over_on_purpose_may_be_tilted(look):
    tilted = LEVEL._replace(rotation=quaternion_from_euler(3.0, 0, 0))
    assert look(imu=tilted, mode=BodyMode.RECOVERING) is None


def test_a_silent_imu_damps(look):
    assert look(imu=None, imu_age=0.3) == (StopStage.DAMP, "imu: no valid frame for 0.30 s")


def test_a_hot_joint_makes_it_sit_down(look):
    assert look(change={"temperature": 86.0}) == (StopStage.SIT, "FL_hip: 86 C, 85 is its limit")


def test_an_empty_battery_makes_it_sit_down(look):
    assert look(mode=BodyMode.STANDING, battery=9.0, cycles=140) is None
    assert look(mode=BodyMode.STANDING, battery=9.0, cycles=20).stage is StopStage.SIT


def test_a_low_supply_makes_it_sit_down_and_names_who_saw_it(look):
    assert look(mode=BodyMode.STANDING, change={"voltage": 39.0}, cycles=140) is None
    assert look(mode=BodyMode.STANDING, change={"voltage": 39.0}, cycles=20) == (
        StopStage.SIT,
        "FL_hip: supply at 39.0 V, it sits down at 40 V",
    )


def test_a_supply_that_sags_under_load_for_a_moment_does_not(look):
    assert look(mode=BodyMode.STANDING, voltage=39.0, cycles=100) is None
    assert look(voltage=47.0) is None
    assert look(mode=BodyMode.STANDING, voltage=39.0, cycles=100) is None


def test_an_angle_that_never_changes_while_its_target_does_is_a_stuck_encoder(dog, look):
    stance = dog.stance(0.27)
    assert look(cycles=10) is None
    sent = [angle + 0.25 * (number == 1) for number, angle in enumerate(stance)]
    assert "its encoder is stuck" in look(targets=sent).cause


def test_an_imu_that_says_the_same_counts_only_while_it_walks(look):
    assert look(cycles=100, mode=BodyMode.STANDING) is None
    assert look(cycles=32).cause == "imu: frozen, exactly the same for 0.32 s of walking"


def test_the_hardest_reason_wins(look):
    trip = look(change={"power": Power.FAULT, "fault": "encoder"}, battery=5.0, cycles=200)
    assert trip.cause == "FL_hip: encoder"


def test_a_dog_that_is_off_needs_no_feedback(look):
    assert look(change={"age": float("inf"), "power": Power.ABSENT}, mode=BodyMode.OFF, imu=None) is None


def test_a_warm_joint_slows_the_dog_down(dog):
    joints = [JointFeedback(temperature=40.0)] * 11
    share = Monitor(dog).speed_share(JointsFeedback.of([*joints, JointFeedback(temperature=79.0)]))
    assert share == pytest.approx(0.4)
    assert Monitor(dog).speed_share(JointsFeedback.of([*joints, JointFeedback(temperature=60.0)])) == 1.0
