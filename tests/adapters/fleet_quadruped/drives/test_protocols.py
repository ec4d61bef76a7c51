"""Drive protocols are entry points; what each of them refuses in a description; motors and IMUs by YAML."""

import re

import pytest

from fleet import Quaternion
from fleet.errors import ConfigError
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.drives import drive_kind, drives_of
from fleet_quadruped.drives.mit.drive import MitDrives
from fleet_quadruped.robot.description import load_description
from fleet_quadruped.sim.lockstep import SimBus
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig


def refused(path):
    with pytest.raises(ConfigError) as caught:
        load_description(path)
    return str(caught.value)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return what installs a package with one drive protocol, as a third party's is."""

    def install(name, value, source):
        folder = tmp_path / f"{name}_drives-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}-drives\nVersion: 1.0\n")
        (folder / "entry_points.txt").write_text(f"[fleet.quadruped_drives]\n{name} = {value}\n")
        (tmp_path / f"{name}_drives.py").write_text(source)

    monkeypatch.syspath_prepend(tmp_path)
    yield install
    drive_kind.cache_clear()


QUIET = """
from fleet_quadruped.drives.mit.drive import MitDrives

class QuietDrives(MitDrives):
    @staticmethod
    def load(drive, joints, bus):
        return 0.001 * joints
"""


def test_a_protocol_is_an_entry_point_of_any_package(package, write_dog):
    package("quiet", "quiet_drives:QuietDrives", QUIET)
    quiet = load_description(write_dog(("protocol: cia402", "protocol: quiet\n  profile: damiao-8006")))
    assert 0.012 < quiet.loads["a"] < 0.1
    assert type(drives_of(quiet, {"a": SimBus("a")})).__name__ == "QuietDrives"


@pytest.mark.parametrize(
    ("name", "value", "source", "expected"),
    [
        ("broken", "broken_drives:X", "import nothing_of_this_name", "cannot be loaded: ModuleNotFoundError"),
        ("absent", "absent_drives:X", "", "cannot be loaded: AttributeError"),
        ("empty", "empty_drives:X", "class X: pass", "not a class of joint drives: it has no problems, load"),
        (
            "mit",
            "mit_drives:X",
            "class X: pass",
            r"is there more than once \(fleet_quadruped.*, mit_drives:X",
        ),
    ],
)
def test_a_package_that_brings_no_drives_is_reported(package, write_dog, name, value, source, expected):  # noqa: PLR0917
    package(name, value, source)
    drive_kind.cache_clear()
    assert re.search(expected, refused(write_dog(("protocol: cia402", f"protocol: {name}"))))


# -- motors of the MIT kind ----------------------------------------------------------------------------

OWN = """protocol: mit
  profile: damiao-8006
  profiles:
    workshop: {angle: 6.3, speed: 40, torque: 33, kp: 400, kd: 8}"""
OWN_KNEES = ("knee: {limits", "knee: {profile: workshop, limits")


def test_a_dog_may_have_several_motors_one_of_them_described_in_yaml(write_dog):
    dog = load_description(write_dog(("protocol: cia402", OWN), OWN_KNEES))
    hip, knee = dog.all_joints[1], dog.all_joints[2]
    assert (MitDrives.farthest(hip, dog.drive), MitDrives.farthest(knee, dog.drive)) == (12.5, 6.3)
    assert MitDrives.identifiers(dog.drive, hip) == (2, 0x12)
    assert MitDrives.identifiers(dog.drive, knee) == (3,)
    assert MitDrives.shared(dog) == (0, 0x7FF)


def test_a_dog_with_several_motors_walks(write_dog):
    dog = load_description(write_dog(("protocol: cia402", OWN), OWN_KNEES))
    rig = Rig(dog, MujocoWorld(dog))
    rig.stand()
    rig.go(1.5, Twist(0.4))
    start = rig.sim.world.place()
    rig.go(2.0, Twist(0.4))
    assert rig.sim.world.place()[0] - start[0] == pytest.approx(0.8, rel=0.1)
    assert rig.fault == ""


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            [("hip:  {limits", "hip:  {profile: dm-1, limits")],
            "actuators.hip.profile: there is no 'dm-1'; there are cubemars-ak10-9",
        ),
        ([("workshop:", "damiao-8006:")], "drive.profiles: damiao-8006 is built in"),
        ([("angle: 6.3", "angle: 2.0"), OWN_KNEES], "its drive's frames end at 2; look at"),
    ],
)
def test_a_motor_that_cannot_be_is_refused(write_dog, changes, expected):
    path = write_dog(("protocol: cia402", OWN))
    text = path.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text)
    assert expected in refused(path)


# -- ODrive and moteus ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("id: 12,", "id: 63,"), "joints.RR_knee: id 63 is no node of an ODrive; the highest is 62"),
        (("timeout: 0.1\n  heart", "timeout: 0.03\n  heart"), "drive.timeout: 0.03 s is less than 4"),
        (("torque: 24, kp: 60, kd: 2", "torque: 24, kp: 60, kd: 0"), "actuators.abad: kd must not be 0"),
        (("id: 0x361", "id: 0x109"), "battery and joints.RL_hip (id 8) have the same frame 109h on bus 'a'"),
    ],
)
def test_what_odrives_cannot_do_is_refused(write_dog, change, expected):
    lamp = ("id: 0x121", "id: 0x721")  # 121h is the heartbeat of node 9
    assert expected in refused(write_dog(("protocol: cia402", "protocol: odrive"), lamp, change))


def test_servos_on_a_classic_bus_are_refused(write_dog):
    refusal = refused(write_dog(("protocol: cia402", "protocol: moteus")))
    assert "buses.a: moteus needs CAN FD; give it a data_bitrate, like 5000000" in refusal


def test_a_sensor_whose_frames_a_servo_would_obey_is_refused(write_dog):
    path = write_dog(
        ("protocol: cia402", "protocol: moteus"),
        ("bitrate: 1000000", "bitrate: 1000000, data_bitrate: 5000000"),
        ("id: 0x361", "id: 0x308"),
    )
    assert "battery and joints.RL_hip (id 8) have the same frame 308h" in refused(path)


# -- IMUs ------------------------------------------------------------------------------------------------

QUATERNION = """qw: {at: 0, type: i16, scale: 3.0518509475997192e-05}
        qx: {at: 2, type: i16, scale: 3.0518509475997192e-05}
        qy: {at: 4, type: i16, scale: 3.0518509475997192e-05}
        qz: {at: 6, type: i16, scale: 3.0518509475997192e-05}"""


def fields(*names):
    return "\n        ".join(
        f"{name}: {{at: {2 * at}, type: i16, scale: 0.0001}}" for at, name in enumerate(names)
    )


def test_an_imu_may_tell_roll_pitch_and_yaw(write_dog):
    rig = Rig(load_description(write_dog((QUATERNION, fields("roll", "pitch", "yaw")))))
    rig.stand()
    rig.go(2.0, Twist(0.0, 0.0, 0.5))
    assert (rig.mode.value, rig.fault) == ("walking", "")
    assert Quaternion(*rig.state().rotation).yaw == pytest.approx(rig.sim.world.imu().rotation.yaw, abs=0.02)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("roll", "pitch"), "imu: yaw is in none of its frames"),
        (("qw", "qx", "qy"), "imu: qz is in none of its frames"),
        (("qw", "qx", "qy", "roll"), "imu: it reports its attitude twice"),
    ],
)
def test_an_imu_that_does_not_tell_its_attitude_is_refused(write_dog, names, expected):
    assert expected in refused(write_dog((QUATERNION, fields(*names))))
