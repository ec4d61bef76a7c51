"""Requests to the body: when they are met already, and why the drives are not enabled for them."""

import math

import pytest

from fleet import Quaternion, Vector3
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.body.requests import ALREADY, ENTERED, STARTED, BodyRequest, refusal
from fleet_quadruped.safety.stages import BodyMode

OFF = BodyMode.OFF
each_start = pytest.mark.parametrize("request_", STARTED)


def lying(roll):
    """Return the measurement of a dog that is rolled over by some radians."""
    turn = Quaternion(math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    return MeasuredImu(turn, Vector3(), Vector3(0.0, 0.0, 9.81))


LEVEL = lying(0.0)


def refused(request, mode=OFF, *, fault="", imu=LEVEL, can_roll=True):
    return refusal(request, mode, fault, imu, can_roll=can_roll)


@each_start
def test_a_dog_that_is_off_and_lies_level_may_do_anything(request_):
    assert refused(request_) == ""


@each_start
@pytest.mark.parametrize("mode", [mode for mode in BodyMode if mode is not OFF])
def test_nothing_is_started_before_the_dog_is_off(request_, mode):
    hint = "; stop it first" if request_ is BodyRequest.POSE else ""
    assert refused(request_, mode) == f"it is {mode.value}{hint}"


@pytest.mark.parametrize("request_", [request for request in BodyRequest if request not in STARTED])
def test_what_is_no_start_needs_a_dog_that_is_up(request_):
    assert refused(request_) == "it is off"


@each_start
def test_a_latched_fault_is_told_before_anything_else(request_):
    words = "a fault is latched: RL_hip: hot; look at the dog, then send reset_faults"
    assert refused(request_, fault="RL_hip: hot", imu=lying(3.0)) == words


@pytest.mark.parametrize(
    ("request_", "hint"),
    [
        (BodyRequest.STAND, "send recovery_stand, or check how its IMU is mounted"),
        (BodyRequest.POSE, "put it on its belly"),
    ],
)
def test_a_dog_that_is_not_upright_does_not_rise(request_, hint):
    assert refused(request_, imu=lying(math.acos(0.86))) == ""
    assert refused(request_, imu=lying(math.acos(0.84))) == f"it is not upright; {hint}"
    assert refused(request_, imu=lying(math.pi)) == f"it is not upright; {hint}"


@pytest.mark.parametrize("request_", [BodyRequest.STAND, BodyRequest.POSE])
def test_without_an_imu_a_person_sees_whether_it_is_upright(request_):
    assert refused(request_, imu=None) == ""


@pytest.mark.parametrize("request_", [BodyRequest.RECOVER, BodyRequest.CHECK])
def test_without_an_imu_it_neither_recovers_nor_checks_itself(request_):
    assert refused(request_, imu=None) == "its attitude is unknown without an IMU"


def test_a_dog_on_its_side_recovers_only_with_roll_poses():
    words = "it is not upright and its description has no roll poses; put it on its feet"
    assert refused(BodyRequest.RECOVER, imu=lying(1.5), can_roll=True) == ""
    assert refused(BodyRequest.RECOVER, imu=lying(1.5), can_roll=False) == words
    assert refused(BodyRequest.RECOVER, imu=LEVEL, can_roll=False) == ""


@pytest.mark.parametrize("lean", [-1.0, 1.0])
def test_a_check_needs_a_level_floor(lean):
    assert refused(BodyRequest.CHECK, imu=lying(0.14 * lean)) == ""
    words = "it lies tilted by 0.16 rad; put it on a level floor, on its belly"
    assert refused(BodyRequest.CHECK, imu=lying(0.16 * lean)) == words


def test_a_sitting_dog_is_not_asked_to_sit_and_a_standing_one_not_to_stand():
    for request, modes in ALREADY.items():
        entered = {mode for asked, mode in ENTERED if asked is request}
        assert not modes & entered, "either it is met, or it begins"


def test_every_mode_that_holds_the_dog_up_can_be_left_by_sitting_down():
    up = {BodyMode.STANDING, BodyMode.WALKING, BodyMode.POSING, BodyMode.HELD}
    assert {mode for mode in up if ENTERED.get((BodyRequest.SIT, mode)) is BodyMode.SITTING} == up


def test_a_recovery_that_is_ended_does_not_move_the_legs_again():
    assert ENTERED[BodyRequest.SIT, BodyMode.RECOVERING] is BodyMode.SETTLING
