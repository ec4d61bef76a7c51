"""One MIT motor: what it says of itself, whether it may hold the robot, and what is sent to it."""

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.mit import frames as wire_frames
from fleet_quadruped.drives.mit.frames import CLEAR, DISABLE, ENABLE, MitLayout
from fleet_quadruped.drives.mit.motor import MitMotor
from fleet_quadruped.drives.mit.profiles import PROFILES
from fleet_quadruped.drives.motor_units import Units

DAMIAO, SILENT, WITH_ERRORS = "damiao-8006", "tmotor-ak80-9", "cubemars-ak70-10"
ON, OFF = 1, 0


class Bench:
    """A motor, and what it replies: of a joint with a ratio of 2 that is turned around."""

    def __init__(self, joint_of, wire, name):
        joint = joint_of(number=3, sign=-1, ratio=2.0)
        self.layout, self.wire = MitLayout(PROFILES[name]), wire
        self.motor = MitMotor(joint, wire, 3, Units(joint), PROFILES[name], self.layout, 0)

    def reply(self, status=None, *, angle=0.0, speed=0.0, torque=0.0, temperature=None, now=1.0):
        self.motor.handle_reply(self.layout.pack_reply((3, angle, speed, torque, status, temperature)), now)
        return self

    @property
    def power(self):
        return self.motor.power(1.0)

    def commands(self):
        """Return what was sent since the last look: by name, or decoded."""
        names = {ENABLE: "enable", DISABLE: "disable", CLEAR: "clear"}
        return [names.get(data) or self.layout.unpack_command(data) for data in self.wire.data]


@pytest.fixture
def bench(joint_of, wire):
    return lambda name=DAMIAO: Bench(joint_of, wire, name)


def test_a_reply_is_what_the_joint_does(bench):
    motor = bench().reply(ON, angle=1.0, speed=4.0, torque=-3.0, temperature=41.0, now=7.0).motor
    assert motor.angle == pytest.approx(-0.5, abs=1e-3)
    assert motor.speed == pytest.approx(-2.0, abs=0.02)
    assert motor.torque == pytest.approx(6.0, abs=0.05)
    assert (motor.temperature, motor.reported_at, motor.status) == (41.0, 7.0, ON)
    assert motor.answers.complete


def test_a_reply_that_is_cut_short_is_none(bench):
    it = bench()
    it.motor.handle_reply(b"\x13\x80\x00\x80\x00", 1.0)
    assert it.power == (Power.ABSENT, "")
    assert not it.motor.answers.complete


@pytest.mark.parametrize("name", [DAMIAO, SILENT, WITH_ERRORS])
def test_a_motor_that_never_replied_is_absent(bench, name):
    it = bench(name)
    it.motor.enable()
    assert it.power == (Power.ABSENT, "")


def test_a_damiao_motor_is_what_it_says(bench):
    it = bench().reply(OFF)
    it.motor.wanted = Power.ENABLED
    assert it.power == (Power.DISABLED, "")
    assert it.reply(ON).power == (Power.ENABLED, "")
    it.motor.wanted = Power.STOPPING
    assert it.power == (Power.STOPPING, "")


@pytest.mark.parametrize("name", [SILENT, WITH_ERRORS])
def test_a_motor_that_says_no_status_may_hold_until_it_was_told_to_be_off(bench, name):
    it = bench(name).reply(0)
    assert it.power == (Power.STOPPING, ""), "nobody knows what it did before"
    it.motor.disable()
    assert it.reply(0).power == (Power.DISABLED, "")


@pytest.mark.parametrize("name", [SILENT, WITH_ERRORS])
def test_a_motor_that_says_no_status_is_enabled_once_it_answers_that_it_was_told_so(bench, name):
    it = bench(name).reply(0)
    it.motor.wanted = Power.ENABLED
    it.motor.enable()
    assert it.power == (Power.DISABLED, ""), "it has answered, but before"
    assert it.reply(0).power == (Power.ENABLED, "")
    it.motor.enable()
    assert it.power == (Power.ENABLED, "")


@pytest.mark.parametrize(("status", "words"), sorted(wire_frames.STATUS.items()))
def test_a_fault_of_a_damiao_motor_is_told_in_words_and_by_its_number(bench, status, words):
    assert bench().reply(status).power == (Power.FAULT, f"{words} (status {status:X}h)")


def test_an_error_of_another_motor_is_told_by_its_number(bench):
    it = bench(WITH_ERRORS).reply(0)
    assert it.reply(4).power == (Power.FAULT, "error 4 of the motor")


def test_two_motors_with_one_id_are_a_fault(bench):
    it = bench().reply(ON)
    it.motor.answers.doubled = True
    assert it.power == (Power.FAULT, "two drives answer as id 3 on bus a: give each its own")


def test_a_damiao_motor_that_lets_go_by_itself_is_a_fault(bench):
    it = bench()
    it.motor.wanted = Power.ENABLED
    assert it.reply(ON).reply(OFF).power == (
        Power.FAULT,
        "id 3 switched its torque off (status 0h); it is configured again after a reset",
    )


@pytest.mark.parametrize("error", range(1, 8))
def test_a_motor_without_a_status_is_not_said_to_have_let_go_when_its_error_is_over(bench, error):
    it = bench(WITH_ERRORS)
    it.motor.wanted = Power.ENABLED
    it.motor.enable()
    assert it.reply(error).power[0] is Power.FAULT
    assert it.reply(0).power == (Power.ENABLED, "")


def test_a_motor_that_is_off_is_enabled_and_one_that_is_on_is_held_where_it_is_without_force(bench):
    it = bench().reply(OFF)
    it.motor.enable()
    assert it.commands() == ["enable"]
    it.reply(ON, angle=1.0)
    it.motor.enable()
    ((angle, speed, kp, kd, torque),) = it.commands()
    assert (angle, kp, kd) == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)
    assert (speed, torque) == pytest.approx((0.0, 0.0), abs=0.05)


@pytest.mark.parametrize("name", [DAMIAO, SILENT])
def test_torque_is_taken_off_by_the_motors_own_frame(bench, name):
    it = bench(name).reply(ON)
    it.motor.disable()
    assert it.commands() == ["disable"]


def test_a_motor_that_says_no_status_is_enabled_again_after_it_was_off(bench):
    it = bench(SILENT).reply()
    for _ in range(2):
        it.motor.enable()
        assert it.commands() == ["enable"]
        assert not it.motor.is_enabled
        assert it.reply().motor.is_enabled
        it.motor.disable()
        assert not it.motor.is_enabled
        assert it.commands() == ["disable"]


def test_damping_has_no_stiffness_and_that_of_the_motor_is_by_the_square_of_its_ratio(bench):
    it = bench().reply(ON, angle=1.0)
    frame = it.motor.damping(3.0)
    angle, _, kp, kd, _ = it.layout.unpack_command(frame.data)
    assert (frame.id, kp) == (3, 0.0)
    assert (angle, kd) == pytest.approx((1.0, 3.0 / 4), abs=2e-3)
    assert it.commands() == [], "it is returned, not sent"


def test_what_is_sent_has_the_motors_identifier(bench):
    it = bench()
    it.motor.send(b"12345678")
    assert it.wire.sent == [CanFrame(3, b"12345678")]
