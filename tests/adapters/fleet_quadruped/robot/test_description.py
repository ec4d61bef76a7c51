import re

import pytest

from fleet.errors import ConfigError
from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.robot.names import JOINTS


def refused(path):
    with pytest.raises(ConfigError) as caught:
        load_description(path)
    return str(caught.value)


def test_the_example_dog_is_accepted():
    dog = load_description(EXAMPLE)
    assert [joint.name for joint in dog.all_joints] == list(JOINTS)


def test_a_file_that_is_not_there_is_reported(tmp_path):
    assert "No such file" in refused(tmp_path / "nothing.yaml")


def test_a_slip_in_the_yaml_is_reported_with_its_line(write_dog):
    assert "dog.yaml:7" in refused(write_dog(("robot: {name: example, mass: 12.6}", "robot: {name: example")))


def test_a_joint_that_is_there_twice_is_refused(write_dog):
    line = "  RR_knee: {bus: a, id: 12, sign: -1}\n"
    refusal = refused(write_dog((line, line + line.replace("12", "13"))))
    assert re.search(r"dog.yaml:\d\d: the key 'RR_knee' is there twice$", refusal)


def test_an_unknown_key_is_refused(write_dog):
    assert "gait.hight" in refused(write_dog(("gait: {height: 0.27", "gait: {hight: 0.27")))


def test_two_drives_with_one_id_are_refused(write_dog):
    refusal = refused(write_dog(("FL_hip:  {bus: a, id: 2", "FL_hip:  {bus: a, id: 1")))
    assert "FL_hip (id 1) and joints.FL_abad (id 1) have the same frame 081h on bus 'a'" in refusal


DAMIAO = ("protocol: cia402", "protocol: mit\n  profile: damiao-8006")


def test_a_motor_that_would_obey_the_answers_of_another_is_refused(write_dog):
    path = write_dog(DAMIAO, ("FR_abad: {bus: a, id: 4", "FR_abad: {bus: a, id: 17"))
    assert "joints.FR_abad (id 17) and joints.FL_abad (id 1) have the same frame 011h" in refused(path)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("id: 0x361", "id: 0x201", "battery and joints.FL_abad (id 1) have the same frame 201h on bus 'a'"),
        ("id: 0x110", "id: 0x181", "imu and joints.FL_abad (id 1) have the same frame 181h"),
        ("id: 0x121", "id: 0x0", "led and the drives' protocol have the same frame 000h"),
        ("id: 12,", "id: 127,", "RR_knee (id 127) and the drives' protocol have the same frame 77Fh"),
    ],
)
def test_what_would_speak_with_the_frames_of_the_drives_is_refused(write_dog, old, new, expected):
    assert expected in refused(write_dog((old, new)))


def test_a_joint_that_its_drive_cannot_tell_to_the_end_is_refused(write_dog):
    path = write_dog(DAMIAO, ("knee: {limits: [-2.75, -0.4],", "knee: {limits: [-2.75, -0.4], ratio: 6,"))
    assert "FL_knee: its limits are -16.5 to -2.4 rad of the motor, and its drive's frames end at 12.5" in (
        refused(path)
    )
    path = write_dog(
        ("FL_hip:  {bus: a, id: 2, sign: 1, offset: 0.3", "FL_hip:  {bus: a, id: 2, offset: 1e6")
    )
    assert "rad of the motor, and its drive's frames end at 1.074e+05" in refused(path)


def test_a_missing_joint_is_refused(write_dog):
    refusal = refused(write_dog(("  RR_knee: {bus: a, id: 12, sign: -1}\n", "")))
    assert "RR_knee is missing" in refusal


def test_a_bus_that_is_not_there_is_refused(write_dog):
    assert "there is no bus 'b'" in refused(write_dog(("FL_abad: {bus: a", "FL_abad: {bus: b")))


def test_a_bus_that_would_be_too_full_is_refused(write_dog):
    refusal = refused(write_dog(("cycle_hz: 100", "cycle_hz: 200")))
    assert "buses: a would be 79% full, more than 60%" in refusal


def test_a_posture_outside_the_limits_is_refused(write_dog):
    refusal = refused(write_dog(("knee: -2.65", "knee: -2.9")))
    assert "poses.fold: FL_knee at -2.90 rad is outside" in refusal


def test_a_height_the_legs_cannot_reach_is_refused(write_dog):
    assert "the legs cannot stand at 0.5 m" in refused(write_dog(("highest: 0.32", "highest: 0.5")))


def test_limits_the_wrong_way_round_are_refused(write_dog):
    assert "must be the smaller" in refused(write_dog(("limits: [-0.95, 0.95]", "limits: [0.95, -0.95]")))


def test_half_of_a_roll_pose_is_refused(write_dog):
    assert "belong together" in refused(
        write_dog(("  roll_far: {abad: 0.288, hip: 3.245, knee: -0.955}\n", ""))
    )


def test_abduction_is_mirrored_on_the_right(dog):
    left, right = (dog.all_joints[JOINTS.index(name)] for name in ("FL_abad", "FR_abad"))
    assert (left.low, left.high) == (-right.high, -right.low)


def test_a_motor_angle_leads_back_to_its_joint(dog):
    for joint in dog.all_joints:
        assert joint.angle(joint.motor(0.37)) == pytest.approx(0.37)


def test_a_protocol_that_nobody_speaks_is_reported_with_those_there_are(write_dog):
    with pytest.raises(ConfigError, match=r"there is no 'lego'; there are cia402, mit, moteus"):
        load_description(write_dog(("protocol: cia402", "protocol: lego")))


@pytest.mark.parametrize(
    ("right", "wrong", "expected"),
    [
        ("cycle_hz", "cycel_hz", "dog.yaml: drive.cycel_hz: unknown key, did you mean 'cycle_hz'?"),
        ("duty: 0.58", "duty: 1.5", "dog.yaml: gait.duty: Input should be less than 0.9, not 1.5"),
        ("heartbeat: 0.05", "heartbeat: 50ms", "unable to parse string as a number, not '50ms'"),
        (
            "protocol: cia402",
            "protocol: mit\n  profile: dm-8006",
            "dog.yaml: drive.profile: there is no 'dm-8006'",
        ),
    ],
)
def test_a_slip_is_reported_with_what_was_meant(write_dog, right, wrong, expected):
    assert expected in refused(write_dog((right, wrong)))


def test_all_slips_are_reported_in_one_line(write_dog):
    refusal = refused(write_dog(("duty: 0.58", "duty: 1.5"), ("mass: 12.6", "mass: -1")))
    assert "gait.duty" in refusal
    assert "robot.mass" in refusal
    assert "\n" not in refusal
