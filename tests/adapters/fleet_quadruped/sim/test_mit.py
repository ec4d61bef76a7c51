"""A simulated MIT motor: what it answers and follows, its registers, and its watchdog (Damiao)."""

import struct

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.frames import MitCommand, MitLayout
from fleet_quadruped.drives.mit.profiles import PROFILES
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.mit import SimMitDrive
from fleet_quadruped.sim.world import SimMotor

MOTOR = 3
OVER_CURRENT, LOST = 0xA, 0xD


class Bench:
    """A motor with a ratio of 2 that is turned around, and what it sent."""

    def __init__(self, joint_of, profile="damiao-8006", *, ratio=2.0):
        self.motor, self.heard = SimMotor(), []
        joint = joint_of(number=MOTOR, sign=-1, ratio=ratio)
        self.drive = SimMitDrive(joint, self.motor, self.heard.append, Drive(protocol="mit", profile=profile))
        self.layout, self.damiao = MitLayout(PROFILES[profile]), PROFILES[profile].damiao

    def send(self, data, identifier=MOTOR):
        self.heard.clear()
        self.drive.hears[identifier](CanFrame(identifier, data))
        return self

    def command(self, **values):
        return self.send(self.layout.pack_command(MitCommand(**values)))

    def enable(self):
        return self.send(wire.ENABLE)

    def go(self, seconds):
        for _ in range(round(seconds / 0.002)):
            self.drive.control(0.002)
        return self

    @property
    def reply(self):
        (frame,) = self.heard
        return self.layout.unpack_reply(frame.data)

    def register(self, kind, number, value=bytes(4), motor=MOTOR):
        self.send(struct.pack("<HBB4s", motor, kind, number, value), wire.REGISTERS)
        return [frame.data[4:] for frame in self.heard]


@pytest.fixture
def make(joint_of):
    return lambda *profile, **how: Bench(joint_of, *profile, **how)


@pytest.fixture
def bench(make):
    return make()


def test_a_motor_without_an_order_has_no_torque_and_says_nothing(bench):
    bench.motor.kp = bench.motor.kd = 9.0
    bench.go(1.0)
    assert (bench.motor.kp, bench.motor.kd, bench.heard) == (0.0, 0.0, [])


def test_each_frame_to_it_is_answered_with_what_it_measures(bench):
    bench.motor.angle, bench.motor.speed, bench.motor.torque = 0.5, -1.0, 3.0
    motor, angle, speed, torque, status, temperature = bench.command().reply
    assert (motor, status, temperature) == (MOTOR, wire.DISABLED, 40.0)
    assert (angle, speed, torque) == pytest.approx((-1.0, 2.0, -1.5), abs=0.02)  # of the motor
    assert bench.heard[0].id == wire.MASTER + MOTOR


def test_motors_of_other_makes_answer_on_identifier_zero(make):
    assert make("tmotor-ak80-9").command().heard[0].id == 0


def test_a_command_counts_once_it_is_enabled(bench):
    bench.command(kp=10.0, kd=1.0).go(0.002)
    assert bench.motor.kp == 0.0
    bench.enable().go(0.002)
    assert bench.motor.kp == 0.0, "an old command is forgotten when it is enabled"
    bench.command(angle=1.0, speed=2.0, kp=10.0, kd=1.0, torque=2.0).go(0.002)
    assert (bench.motor.kp, bench.motor.kd) == (pytest.approx(40.0, abs=1.0), pytest.approx(4.0, abs=0.05))
    assert bench.motor.target == pytest.approx(-0.5, abs=0.001)
    assert (bench.motor.target_speed, bench.motor.feed) == (
        pytest.approx(-1.0, abs=0.02),
        pytest.approx(-4.0, abs=0.05),
    )


def test_it_is_disabled_by_a_command_of_its_own(bench):
    bench.enable().command(kp=10.0).send(wire.DISABLE).go(0.002)
    assert (bench.drive.status, bench.motor.kp) == (wire.DISABLED, 0.0)


@pytest.mark.parametrize("data", [b"", wire.ENABLE[:7]])
def test_a_frame_of_another_length_is_neither_obeyed_nor_answered(bench, data):
    assert (bench.send(data).heard, bench.drive.status) == ([], wire.DISABLED)


def test_a_fault_takes_the_torque_off_until_it_is_cleared(bench):
    bench.enable().command(kp=10.0).drive.fail("overcurrent")
    bench.go(0.002)
    assert (bench.motor.kp, bench.command(kp=10.0).reply[4]) == (0.0, OVER_CURRENT)
    assert bench.enable().reply[4] == OVER_CURRENT
    assert bench.send(wire.DISABLE).reply[4] == OVER_CURRENT
    assert bench.send(wire.CLEAR).reply[4] == wire.DISABLED
    assert bench.enable().reply[4] == wire.ENABLED


def test_its_watchdog_is_off_until_it_is_set_in_units_of_50_microseconds(bench):
    assert bench.enable().go(5.0).drive.status == wire.ENABLED
    bench.register(wire.WRITE, wire.TIMEOUT_REGISTER, struct.pack("<I", 2000))
    assert bench.command(kp=10.0).go(0.098).drive.status == wire.ENABLED
    assert bench.command(kp=10.0).go(0.098).drive.status == wire.ENABLED
    assert bench.go(0.004).drive.status == LOST
    assert bench.motor.kp == 0.0
    assert bench.enable().reply[4] == LOST


def test_the_watchdog_of_a_motor_that_is_disabled_does_not_expire(bench):
    bench.register(wire.WRITE, wire.TIMEOUT_REGISTER, struct.pack("<I", 2000))
    assert bench.go(1.0).drive.status == wire.DISABLED


def test_a_motor_without_power_forgets_its_watchdog(bench):
    bench.register(wire.WRITE, wire.TIMEOUT_REGISTER, struct.pack("<I", 2000))
    bench.enable().drive.boot()
    assert bench.drive.status == wire.DISABLED
    assert bench.register(wire.READ, wire.TIMEOUT_REGISTER) == [bytes(4)]
    assert bench.enable().go(1.0).drive.status == wire.ENABLED


def test_its_registers_say_its_ranges_and_where_it_answers(bench):
    profile = PROFILES["damiao-8006"]
    read = [struct.unpack("<f", *bench.register(wire.READ, number))[0] for number in wire.RANGE_REGISTERS]
    assert read == [profile.angle, profile.speed, profile.torque]
    assert bench.register(wire.READ, wire.MASTER_REGISTER) == [struct.pack("<I", 0x13)]
    bench.drive.pretend()
    assert bench.register(wire.READ, wire.RANGE_REGISTERS[0]) == [struct.pack("<f", 25.0)]


@pytest.mark.parametrize(("number", "motor"), [(99, MOTOR), (wire.TIMEOUT_REGISTER, 4)])
def test_another_register_or_motor_is_not_answered(bench, number, motor):
    assert bench.register(wire.READ, number, motor=motor) == []


def test_a_motor_that_refuses_answers_with_what_it_had(bench):
    bench.drive.refuse()
    assert bench.register(wire.WRITE, wire.TIMEOUT_REGISTER, struct.pack("<I", 9)) == [bytes(4)]


def test_motors_of_other_makes_have_no_registers(make):
    assert wire.REGISTERS not in make("tmotor-ak80-9").drive.hears


def test_a_lazy_motor_is_enabled_at_the_fourth_command(bench):
    bench.drive.doze()
    assert [bench.enable().drive.status for _ in range(4)] == [0, 0, 0, wire.ENABLED]


def test_its_faults_are_seen_in_its_answers(bench):
    bench.drive.warm()
    assert bench.go(2.0).command().reply[5] == 60.0
    bench.drive.encoder.shift(0.1)
    bench.enable().command(angle=-1.0, kp=10.0).go(0.002)
    assert bench.motor.target == pytest.approx(0.4, abs=0.001)
    bench.drive.cut_short()
    assert len(bench.command().heard[0].data) == 2
    bench.drive.mute()
    assert bench.drive.hears == {}
