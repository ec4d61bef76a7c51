"""One moteus servo: what it says of itself, when it is not trusted, and what is sent to it."""

import math

import pytest

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.moteus import frames
from fleet_quadruped.drives.moteus.servo import MoteusServo
from fleet_quadruped.drives.motor_units import Units

STOPPED, FAILED, OBEYS, TIMED_OUT, DAMPS, BRAKES = 0, 1, 10, 11, 12, 15
STARTING = [2, 3, 4]
COMMAND = 0x20


class Bench:
    """A servo of a joint with a ratio of 2 that is turned around, and what it says."""

    def __init__(self, joint_of, wire):
        joint = joint_of(number=7, sign=-1, ratio=2.0)
        self.servo = MoteusServo(joint, wire, 7, Units(joint), kp=1.0, kd=0.5, watchdog=0.1, full_kd=2.0)
        self.wire = wire

    def say(self, mode, *, turns=0.0, speed=0.0, torque=0.0, code=0, now=1.0):
        registers = dict(zip(frames._QUERIED, (mode, turns, speed, torque, 2, 24.5, 41.0, code), strict=True))
        self.servo.handle_registers(registers, bytes([mode]), now)
        return self

    @property
    def power(self):
        return self.servo.power(1.0)

    def sent(self):
        """Return (mode, registers of the command from 020h on) of each frame; mode None: only a query."""
        found = []
        for frame in self.wire.sent:
            assert (frame.id, frame.fd) == (0x8007, True)
            parts = [part for part in frames.unpack(frame.data) if part.kind == 0]
            modes = [part.values[0] for part in parts if part.start == frames.MODE]
            command = [part.values for part in parts if part.start == COMMAND]
            found.append((modes[0] if modes else None, command[0] if command else None))
            assert any(part.kind == 1 for part in frames.unpack(frame.data)), "it asks for an answer"
        self.wire.sent = []
        return found


@pytest.fixture
def bench(joint_of, wire):
    return Bench(joint_of, wire)


def test_what_it_says_is_what_the_joint_does(bench):
    servo = bench.say(OBEYS, turns=1.0, speed=-0.5, torque=1.5, now=3.0).servo
    assert (servo.angle, servo.speed, servo.torque) == pytest.approx((-math.pi, math.pi / 2, -3.0))
    assert (servo.voltage, servo.temperature, servo.home, servo.reported_at) == (24.5, 41.0, 2, 3.0)
    assert servo.answers.complete


def test_a_servo_that_never_answered_is_absent(bench):
    assert bench.power == (Power.ABSENT, "")


@pytest.mark.parametrize(
    ("mode", "power"),
    [
        (STOPPED, Power.DISABLED),
        (TIMED_OUT, Power.STOPPING),
        (DAMPS, Power.STOPPING),
        (BRAKES, Power.STOPPING),
        *((mode, Power.STARTING) for mode in STARTING),
    ],
)
def test_a_servo_is_what_its_mode_means(bench, mode, power):
    bench.servo.wanted = Power.ENABLED
    assert bench.say(mode).power == (power, "")


@pytest.mark.parametrize(
    ("wanted", "power"),
    [
        (Power.ENABLED, Power.ENABLED),
        (Power.STOPPING, Power.STOPPING),
        (Power.DISABLED, Power.STOPPING),
    ],
)
def test_a_servo_in_position_mode_is_what_it_should_be(bench, wanted, power):
    bench.servo.wanted = wanted
    assert bench.say(OBEYS).power == (power, "")


@pytest.mark.parametrize("mode", [5, 6, 9, 13, 14, 16])
def test_a_mode_that_nobody_commands_is_a_fault(bench, mode):
    assert bench.say(mode).power == (Power.FAULT, f"id 7 is in mode {mode}, which was not commanded")


def test_a_fault_is_told_in_words_and_by_its_number(bench):
    assert bench.say(FAILED, code=40).power == (Power.FAULT, "under-voltage (register 00Fh is 40)")
    assert bench.say(FAILED, code=99).power == (Power.FAULT, "fault (register 00Fh is 99)")


def test_two_servos_with_one_id_are_a_fault(bench):
    bench.say(OBEYS).servo.answers.doubled = True
    assert bench.power == (Power.FAULT, "two drives answer as id 7 on bus a: give each its own")


@pytest.mark.parametrize("mode", [STOPPED, *STARTING])
def test_a_servo_that_lets_go_by_itself_is_a_fault(bench, mode):
    bench.servo.wanted = Power.ENABLED
    words = "id 7 switched its torque off (mode 0); it is configured again after a reset"
    assert bench.say(OBEYS).say(mode).power == (Power.FAULT, words)


@pytest.mark.parametrize("mode", [FAILED, TIMED_OUT])
def test_a_servo_that_failed_or_timed_out_has_not_restarted(bench, mode):
    bench.servo.wanted = Power.ENABLED
    assert not bench.say(OBEYS).say(mode).servo.restarted


@pytest.mark.parametrize(("most", "limit"), [(None, 12.0), (10.0, 5.0), (24.0, 12.0), (99.0, 12.0)])
def test_a_torque_limit_is_that_of_the_motor_and_no_more_than_the_joints(bench, most, limit):
    assert bench.servo.torque_limit(most) == limit


def test_a_servo_is_held_where_it_is_without_force(bench):
    bench.servo.hold_limp(3.0)
    ((mode, command),) = bench.sent()
    position, velocity, torque, kp, kd, most, stop, watchdog = command
    assert (mode, most) == (OBEYS, 3.0)
    assert math.isnan(position)
    assert math.isnan(stop)
    assert (velocity, torque, kp, kd) == (0.0, 0.0, 0.0, 0.0)
    assert watchdog == pytest.approx(0.1)


def test_damping_is_zero_velocity_with_a_share_of_the_damping_that_the_servo_has(bench):
    bench.say(OBEYS).servo.damp(0.8)
    ((mode, command),) = bench.sent()
    position, velocity, torque, kp, kd, most, _, watchdog = command
    assert math.isnan(position)
    assert (mode, velocity, torque, kp, most) == (DAMPS, 0.0, 0.0, 0.0, 12.0)
    assert kd == pytest.approx(0.8 / 2.0**2 * math.tau / 2.0)
    assert watchdog == pytest.approx(0.1)


def test_damping_is_no_more_than_what_the_servo_has(bench):
    bench.say(OBEYS).servo.damp(50.0)
    ((_, command),) = bench.sent()
    assert command[4] == 1.0


@pytest.mark.parametrize("mode", [STOPPED, FAILED, TIMED_OUT])
def test_a_servo_without_torque_or_that_damps_already_is_only_polled(bench, mode):
    bench.say(mode).servo.damp(0.8)
    assert bench.sent() == [(None, None)]


def test_a_servo_that_never_answered_is_only_polled(bench):
    bench.servo.damp(0.8)
    assert bench.sent() == [(None, None)]


@pytest.mark.parametrize("mode", [OBEYS, TIMED_OUT, DAMPS, BRAKES])
def test_torque_is_taken_off_by_a_stop(bench, mode):
    bench.say(mode).servo.disable()
    assert bench.sent() == [(STOPPED, None)]


@pytest.mark.parametrize("mode", [STOPPED, FAILED])
def test_a_servo_without_torque_is_not_stopped_because_a_stop_clears_its_fault(bench, mode):
    bench.say(mode).servo.disable()
    assert bench.sent() == [(None, None)]
