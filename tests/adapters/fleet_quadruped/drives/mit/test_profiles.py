"""Profiles of MIT motors: the ranges of their frames, from their manuals or from YAML."""

import pytest

from fleet_quadruped.drives.mit.profiles import PROFILES, MotorProfile, profile_name, profile_of
from fleet_quadruped.robot.parts import Actuator, Drive, Motor

OWN = Motor(angle=6.3, speed=40, torque=33, kp=400, kd=8, temperature_at=6, coldest=-40, error_at=7)


def kind(profile=""):
    return Actuator(limits=(-1.0, 1.0), velocity=10.0, torque=20.0, profile=profile)


def drive(**more):
    return Drive(protocol="mit", profile="damiao-8006", **more)


def test_joints_have_the_motor_of_the_robot_unless_their_kind_has_another():
    assert profile_name(drive(), kind()) == "damiao-8006"
    assert profile_name(drive(), kind("tmotor-ak80-9")) == "tmotor-ak80-9"
    assert profile_of(drive(), kind()) is PROFILES["damiao-8006"]
    assert profile_of(drive(), kind("tmotor-ak80-9")) is PROFILES["tmotor-ak80-9"]


def test_a_motor_described_in_yaml_has_what_is_described():
    found = profile_of(drive(profiles={"workshop": OWN}), kind("workshop"))
    assert found == MotorProfile(6.3, 40, 33, 400, 8, False, 6, -40, 7)


def test_what_yaml_leaves_out_is_as_in_the_frames_of_most_motors():
    found = profile_of(drive(profiles={"plain": Motor(angle=1, speed=2, torque=3)}), kind("plain"))
    assert found == MotorProfile(1, 2, 3)
    assert (found.kp, found.kd, found.damiao, found.temperature_at, found.error_at) == (
        500,
        5,
        False,
        None,
        None,
    )


def test_a_motor_that_nobody_described_is_an_error():
    with pytest.raises(KeyError, match="dm-1"):
        profile_of(drive(), kind("dm-1"))


@pytest.mark.parametrize("name", PROFILES)
def test_a_built_in_motor_has_ranges_and_says_its_state_in_one_way(name):
    profile = PROFILES[name]
    assert min(profile.angle, profile.speed, profile.torque, profile.kp, profile.kd) > 0
    assert profile.damiao is name.startswith("damiao-")
    assert not (profile.damiao and profile.error_at is not None)
    assert profile.temperature_at in {None, 6, 7}
    assert profile.temperature_at is None or profile.temperature_at != profile.error_at


@pytest.mark.parametrize(
    ("name", "ranges"),
    [
        ("tmotor-ak80-9", (12.5, 25.64, 18.0)),
        ("cubemars-ak10-9", (12.5, 50.0, 65.0)),
        ("damiao-4340", (12.5, 8.0, 28.0)),
        ("damiao-8009", (12.5, 45.0, 54.0)),
    ],
)
def test_ranges_are_those_of_the_manuals(name, ranges):
    assert PROFILES[name][:3] == ranges


def test_a_built_in_profile_cannot_be_changed():
    with pytest.raises(TypeError):
        PROFILES["damiao-8006"] = MotorProfile(1, 1, 1)
