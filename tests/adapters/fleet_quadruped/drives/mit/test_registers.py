"""Registers of Damiao motors: ranges that must be those of the profile, and a watchdog that is kept."""

import struct

import pytest

from fleet import CanFrame, LinkLost, LinkRefused
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.mit import frames
from fleet_quadruped.drives.mit.frames import MitLayout
from fleet_quadruped.drives.mit.motor import MitMotor
from fleet_quadruped.drives.mit.profiles import PROFILES
from fleet_quadruped.drives.mit.registers import DamiaoRegisters
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.parts import Drive

PROFILE = PROFILES["damiao-8006"]
DRIVE = Drive(protocol="mit", profile="damiao-8006", timeout=0.1)
WATCHDOG = 9


def real(value):
    return struct.pack("<f", value)


class Motors:
    """Two motors with registers; ``mute`` ones do not answer, ``forgets``: those that keep nothing."""

    def __init__(self, joint_of, wire):
        self.wire, self.mute, self.forgets = wire, set(), set()
        self.motors = [
            self._motor(joint_of(name, number=number)) for name, number in (("hip", 2), ("knee", 3))
        ]
        self.memory = {
            motor.id: {21: real(12.5), 22: real(45.0), 23: real(40.0), WATCHDOG: bytes(4)}
            for motor in self.motors
        }
        wire.send = self._heard
        self.registers = DamiaoRegisters(self.motors, DriveRequester({"a": wire}, self._take))
        self.written = []

    def _motor(self, joint):
        return MitMotor(joint, self.wire, joint.id, Units(joint), PROFILE, MitLayout(PROFILE), 0)

    def _heard(self, frame):
        assert frame.id == 0x7FF
        number, kind, register, value = struct.unpack("<HBB4s", frame.data)
        if number in self.mute:
            return
        if kind == 0x55:
            self.written.append((number, register, value))
            if number not in self.forgets:
                self.memory[number][register] = value
        answer = struct.pack(
            "<HBB4s", number, kind, register, value if kind == 0x55 else self.memory[number][register]
        )
        self.wire.heard.append([CanFrame(0x10 + number, answer)])

    def _take(self, bus, frame, now):
        for motor in self.motors:
            self.registers.handle_answer(motor, frame.data)

    def commission(self, drive=DRIVE):
        self.registers.commission(drive)


@pytest.fixture
def motors(joint_of, wire):
    return Motors(joint_of, wire)


@pytest.mark.parametrize(("timeout", "ticks"), [(0.1, 2000), (0.5, 10_000), (0.00001, 1)])
def test_the_watchdog_of_each_motor_is_set_in_steps_of_50_microseconds(motors, timeout, ticks):
    motors.commission(DRIVE.model_copy(update={"timeout": timeout}))
    assert motors.written == [(number, WATCHDOG, struct.pack("<I", ticks)) for number in (2, 3)]


def test_a_motor_that_does_not_keep_its_watchdog_is_refused(motors):
    motors.forgets.add(3)
    with pytest.raises(LinkRefused, match=r"knee: register 9 \(watchdog\) is b'\\x00.*, not b'\\xd0\\x07"):
        motors.commission()


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (21, 3.14, "knee: register 21 (PMAX) is 3.14, wanted 12.5 for damiao-8006"),
        (22, 30.0, "knee: register 22 (VMAX) is 30, wanted 45 for damiao-8006"),
        (23, 10.0, "knee: register 23 (TMAX) is 10, wanted 40 for damiao-8006"),
        (23, float("nan"), "knee: register 23 (TMAX) is nan, wanted 40 for damiao-8006"),
    ],
)
def test_a_motor_with_other_ranges_is_refused_before_anything_is_written(motors, register, value, words):
    motors.memory[3][register] = real(value)
    with pytest.raises(LinkRefused) as caught:
        motors.commission()
    assert str(caught.value) == words
    assert motors.written == []


@pytest.mark.parametrize(("torque", "taken"), [(40.03, True), (40.05, False), (39.97, True), (39.95, False)])
def test_ranges_may_differ_by_a_thousandth(motors, torque, taken):
    motors.memory[2][23] = real(torque)
    if taken:
        motors.commission()
    else:
        with pytest.raises(LinkRefused, match="hip: register 23"):
            motors.commission()


def test_a_silent_motor_is_named(motors):
    motors.mute.add(3)
    with pytest.raises(LinkLost, match="knee: id 3 on bus 'a' is silent"):
        motors.commission()


def test_a_motor_that_was_off_meanwhile_gets_its_watchdog_again(motors):
    motors.commission()
    motors.memory[3][WATCHDOG] = bytes(4)
    motors.commission()
    assert motors.memory[3][WATCHDOG] == struct.pack("<I", 2000)


def test_a_motor_that_was_exchanged_meanwhile_is_checked_again(motors):
    motors.commission()
    motors.memory[3][23] = real(10.0)
    with pytest.raises(LinkRefused, match="knee"):
        motors.commission()


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<HBB4s", 9, 0x33, 21, real(12.5)),  # of another motor
        struct.pack("<HBB4s", 2, 0xAA, 21, real(12.5)),  # stores its parameters
        struct.pack("<HBB", 2, 0x33, 21),
        b"",
    ],
)
def test_any_other_frame_is_no_answer(motors, data):
    assert not motors.registers.handle_answer(motors.motors[0], data)


def test_an_answer_to_a_read_or_a_write_is_taken(motors):
    for kind in (frames.READ, frames.WRITE):
        data = struct.pack("<HBB4s", 2, kind, 21, real(12.5))
        assert motors.registers.handle_answer(motors.motors[0], data)
