"""A dog on the bench: devices are found, drives are listened to, and none is enabled or dropped."""

import pytest

from fleet import CanFrame
from fleet.errors import LinkLost, LinkRefused
from fleet.testing.clock import ManualClock
from fleet_quadruped import bench_tools as module
from fleet_quadruped.any_description import load_body
from fleet_quadruped.bench_tools import BenchSession, listen, offsets, open_buses, problems, scan
from fleet_quadruped.drives.base import JointFeedback, Power
from fleet_quadruped.drives.mit.frames import MitLayout
from fleet_quadruped.drives.mit.profiles import PROFILES
from fleet_quadruped.frames import encode
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim.lockstep import lockstep
from tests.adapters.fleet_quadruped.control.benches import GivenDrives

RL_HIP = 7


class Ticking(ManualClock):
    """A clock that goes on by ``step`` seconds whenever it is read."""

    def __init__(self, step=0.005):
        super().__init__()
        self._step = step

    def monotonic(self):
        self.advance(self._step)
        return super().monotonic()


class Line:
    """A bus on which some frames are heard, again and again, once something was ``sent`` on it."""

    name = "a"

    def __init__(self, *heard, at_once=False):
        self._heard, self.sent, self._at_once = heard, [], at_once

    def send(self, frame):
        self.sent.append(frame)

    def receive(self, wait):
        return list(self._heard) if self.sent or self._at_once else []


# -- scan ------------------------------------------------------------------------------------------------

DRIVE, MODULE = bytes.fromhex("4300100092010200"), bytes.fromhex("4300100091010300")
ABORT = bytes.fromhex("8000100000000206")
MIT = [CanFrame(0x000, bytes([2, *bytes(7)])), CanFrame(0x015, bytes(8)), CanFrame(0x01F, bytes(6))]


@pytest.mark.parametrize(
    ("heard", "expected"),
    [
        ([CanFrame(0x583, DRIVE)], ["CANopen node 3: drive (CiA 402)"]),
        ([CanFrame(0x583, MODULE)], ["CANopen node 3: profile 401"]),
        ([CanFrame(0x583, ABORT)], ["CANopen node 3: refuses to report its device type"]),
        ([CanFrame(0x703, b"\x7f")], ["CANopen node 3: heartbeat, state 7fh"]),
        ([CanFrame(0x703, b"\x05"), CanFrame(0x583, DRIVE)], ["CANopen node 3: drive (CiA 402)"]),
        ([CanFrame(0x583, DRIVE), CanFrame(0x583, ABORT)], ["CANopen node 3: drive (CiA 402)"]),
        (MIT, [f"MIT motor {n}: answers on {at}h" for n, at in ((2, "000"), (5, "015"), (15, "01F"))]),
        ([CanFrame(0x583, DRIVE[:7]), CanFrame(0x010, bytes(8)), CanFrame(0x015, bytes(5))], []),
        ([CanFrame(0x110, bytes(8)), CanFrame(0x361, bytes(8))], []),  # an IMU, a battery
    ],
)
def test_a_device_is_known_by_what_it_answers(heard, expected):
    assert scan(Line(*heard), Ticking(0.3)) == expected


def test_devices_are_sorted_by_kind_and_number():
    heard = [MIT[1], CanFrame(0x585, DRIVE), CanFrame(0x582, DRIVE), MIT[0]]
    found = scan(Line(*heard), Ticking(0.3))
    assert [line.split(":")[0] for line in found] == [
        "CANopen node 2",
        "CANopen node 5",
        "MIT motor 2",
        "MIT motor 5",
    ]


def test_no_request_of_a_scan_can_move_a_device():
    line = Line()
    scan(line, Ticking(0.3))
    reads = [frame for frame in line.sent if frame.id > 0x600]
    assert [frame.id for frame in reads] == [0x600 + number for number in range(1, 128)]
    assert {frame.data for frame in reads} == {bytes.fromhex("4000100000000000")}
    commands = [frame for frame in line.sent if frame.id < 0x600]
    assert [frame.id for frame in commands] == list(range(1, 16))
    for profile in PROFILES.values():
        for frame in commands:
            _, _, kp, kd, torque = MitLayout(profile).unpack_command(frame.data)
            assert (kp, kd > 0) == (0, True)
            assert abs(torque) <= profile.torque / 4095  # the number nearest to zero


@pytest.mark.parametrize("identifier", [0x080, 0x77F, 0x203, 0x005, 0x8001])
def test_a_bus_with_a_controller_is_not_scanned(identifier):
    line = Line(CanFrame(identifier, bytes(8)), at_once=True)
    with pytest.raises(LinkLost, match="another controller commands the drives"):
        scan(line, Ticking(0.1))
    assert line.sent == []


@pytest.mark.parametrize("protocol", ["cia402", "mit"])  # those that a scan can ask safely
def test_all_twelve_devices_are_found(dogs, protocol):
    _, buses = lockstep(dogs[protocol])
    found = scan(buses["a"], Ticking(0.3))
    assert len(found) == 12
    assert "drive (CiA 402)" in found[0] or "MIT motor" in found[0]


# -- a session ----------------------------------------------------------------------------------------------


@pytest.fixture
def given(dog, monkeypatch):
    """Return drives whose reports a test gives, and what begins a session with them."""
    drives = GivenDrives(dog.posture(dog.poses.fold))
    monkeypatch.setattr(module, "drives_of", lambda dog, buses, joints: drives)
    return drives, lambda: BenchSession(dog, {"a": Line()}, Ticking())


def test_a_dog_on_the_bench_is_never_enabled(any_dog, monkeypatch):
    monkeypatch.setattr(module, "require_sole_controller", lambda *_: None)  # it listens in real time
    sim, buses = lockstep(any_dog)
    bench = BenchSession(any_dog, buses, Ticking())
    feedback = bench.settle(5)
    assert {joint.power for joint in feedback} == {Power.DISABLED}
    assert all(motor.kp == motor.kd == 0 for motor in sim.world.motors)
    assert problems(bench.joints, feedback) == []
    assert offsets(bench.dog, feedback, bench.dog.posture(bench.dog.poses.fold)) == pytest.approx(
        {joint.name: joint.offset for joint in bench.dog.all_joints}, abs=2e-3
    )
    assert bench.frames["a"] > 0


def test_drives_without_torque_need_no_lowering(given):
    drives, begin = given
    drives.report(age=0.0, power=Power.DISABLED)
    begin()
    assert [call for call in drives.calls if call != "begin"] == ["configure", "probe"]


def test_drives_that_hold_are_damped_until_the_dog_lies(given, dog):
    drives, begin = given
    drives.report(age=0.0, power=Power.DISABLED)
    drives.report(RL_HIP, power=Power.STOPPING)
    begin()
    assert drives.calls.count("probe") == round(dog.safety.damp_time / dog.dt)


def test_a_dog_that_would_fall_is_refused(given, monkeypatch):
    drives, begin = given
    drives.report(age=0.0, power=Power.ENABLED)
    monkeypatch.setattr(drives, "probe", lambda kd: False)
    with pytest.raises(
        LinkRefused, match="the drives hold the dog, and it would fall: lower it with fleet run"
    ):
        begin()
    assert "disable" not in drives.calls


def test_drives_that_are_never_heard_are_waited_for_and_not_refused(given, dog):
    drives, begin = given
    session = begin()
    assert drives.calls.count("probe") == round(dog.safety.damp_time / dog.dt)
    drives.calls.clear()
    assert session.settle(2)[0].power is Power.ABSENT
    assert drives.calls.count("disable") == 3


def test_nothing_is_configured_on_a_bus_with_another_controller(dog, given, monkeypatch):
    drives, _ = given
    line = Line(CanFrame(0x201, bytes(8)), at_once=True)
    with pytest.raises(LinkLost, match="another controller"):
        BenchSession(dog, {"a": line}, Ticking())
    assert drives.calls == []


def test_all_buses_are_closed_if_one_of_them_cannot_be_opened(dog, monkeypatch):
    closed = []

    def open_bus(name, url, bitrate, clock, data_bitrate):
        if url == "bad":
            raise LinkLost("it is not there")
        bus = Line()
        bus.close = lambda: closed.append((name, bitrate, data_bitrate))
        return bus

    monkeypatch.setattr(module, "OpenCanBus", open_bus)
    described = {"a": dog.buses["a"], "b": dog.buses["a"]}
    with (
        pytest.raises(LinkLost, match="it is not there"),
        open_buses({"a": "x", "b": "bad"}, described, None),
    ):
        pass
    with open_buses({"a": "x"}, described, None) as buses:
        assert (list(buses), len(closed)) == (["a"], 1)
    assert closed == [("a", 1_000_000, None)] * 2


# -- what feedback says ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, []),
        ({"age": 0.1}, []),
        ({"age": 0.11}, ["RL_hip: id 8 on bus 'a' is silent"]),
        ({"age": 0.11, "fault": "over-current"}, ["RL_hip: id 8 on bus 'a' is silent"]),
        ({"fault": "over-current", "angle": 9.0}, ["RL_hip: over-current"]),
        ({"angle": 3.3}, []),
        ({"angle": 3.31}, ["RL_hip: is at 3.31 rad, outside -1.6 to 3.3: check its sign and offset"]),
        ({"angle": -1.61}, ["RL_hip: is at -1.61 rad, outside -1.6 to 3.3: check its sign and offset"]),
    ],
)
def test_what_speaks_against_enabling_a_joint_is_said(dog, changes, expected):
    reported = [JointFeedback(angle=angle, age=0.0) for angle in dog.stance(0.27)]
    reported[RL_HIP] = reported[RL_HIP]._replace(**changes)
    assert problems(dog.all_joints, tuple(reported)) == expected


def test_an_offset_is_what_is_between_the_pose_and_the_motor(dog):
    pose = dog.posture(dog.poses.fold)
    reported = tuple(JointFeedback(angle=angle + 0.1) for angle in pose)
    assert offsets(dog, reported, pose) == pytest.approx(
        {joint.name: joint.offset + joint.sign * 0.1 for joint in dog.all_joints}, abs=1e-4
    )


def test_a_machine_that_walks_by_itself_is_listened_to():
    walker = load_body(EXAMPLE.with_name("self-walking.yaml"))
    first, *others = walker.wire.state
    line = Line(CanFrame(first.id, encode(first, dict.fromkeys(first.fields, 1.0))), at_once=True)
    found = listen(walker, {"a": line}, Ticking(0.1))
    assert found.values == pytest.approx(dict.fromkeys(first.fields, 1.0), abs=0.01)
    assert found.missing == [
        f"frame {frame.id:03X}h ({', '.join(frame.fields)}) did not come" for frame in others
    ]
    assert line.sent == []
