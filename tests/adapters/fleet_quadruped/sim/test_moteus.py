"""A simulated moteus: its modes, the watchdog of each command, its gains, registers and diagnostics."""

import math
import struct

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.frames import ServoCommand
from fleet_quadruped.sim.moteus import SimMoteus
from fleet_quadruped.sim.world import SimMotor

SERVO, DT, TURN = 3, 0.002, math.tau
TO_SERVO = wire.to_servo(SERVO)
STARTING = 2
KP, KD = "servo.pid_position.kp", "servo.pid_position.kd"


class Bench:
    """A servo with a ratio of 2 that is turned around, and what it sent."""

    def __init__(self, joint_of):
        self.motor, self.heard = SimMotor(), []
        self.servo = SimMoteus(
            joint_of(number=SERVO, sign=-1, ratio=2.0), self.motor, self.heard.append, None
        )

    def send(self, data, *, identifier=TO_SERVO, fd=True):
        self.heard.clear()
        if identifier in self.servo.hears:
            self.servo.hears[identifier](CanFrame(identifier, data, fd=fd))
        return self

    def demand(self, mode=wire.OBEYS, *, turns=math.nan, speed=0.0, torque=0.0, kp=1.0, kd=1.0, watchdog=0.1):
        return self.send(wire.pack_demand(mode, ServoCommand(turns, speed, torque, kp, kd, 5.0, watchdog)))

    def mode(self, mode):
        return self.send(wire.pack_mode(mode))

    def obey(self, **values):
        """Lead it to position mode, and send it a command there."""
        self.demand().go(2 * DT)
        assert self.servo.mode == wire.OBEYS
        return self.demand(**values)

    def go(self, seconds):
        for _ in range(round(seconds / DT)):
            self.servo.control(DT)
        return self

    @property
    def registers(self):
        self.send(wire.pack_query())
        return wire.reply(wire.unpack(self.heard[0].data))

    def ask(self, line):
        """Return what its diagnostics answer to a line."""
        self.send(wire.pack_text(line))
        return b"".join(part.text for part in wire.unpack(self.heard[0].data)).decode()


@pytest.fixture
def bench(joint_of):
    return Bench(joint_of)


def test_it_answers_what_is_asked_with_what_it_measures(bench):
    bench.motor.angle, bench.motor.speed, bench.motor.torque = 0.5, -1.0, 3.0
    found = bench.registers
    assert bench.heard[0].id == wire.from_servo(SERVO)
    assert found[wire.POSITION] == pytest.approx(-1.0 / TURN)
    assert (found[wire.VELOCITY], found[wire.TORQUE]) == pytest.approx((2.0 / TURN, -1.5))
    assert (found[wire.VOLTAGE], found[wire.TEMPERATURE]) == pytest.approx((48.0, 40.0))
    assert (found[wire.MODE], found[wire.FAULT], found[wire.HOME]) == (wire.STOPPED, 0, wire.REFERS_TO_OUTPUT)


@pytest.mark.parametrize(
    ("identifier", "fd"),
    [(wire.to_servo(4), True), (wire.to_servo(SERVO), False), (SERVO, True), (0x203, True)],
)
def test_only_a_frame_of_can_fd_to_it_that_asks_is_answered(bench, identifier, fd):
    assert bench.send(wire.pack_query(), identifier=identifier, fd=fd).heard == []


@pytest.mark.parametrize("identifier", [SERVO, 0x103, 0x703])
def test_any_frame_whose_low_byte_is_its_id_is_obeyed(bench, identifier):
    data = wire.pack_demand(wire.OBEYS, ServoCommand(math.nan, 0.0, 0.0, 1.0, 1.0, 5.0, 1.0))
    bench.send(data, identifier=identifier).go(2 * DT)
    assert bench.servo.mode == wire.OBEYS


def test_a_frame_that_is_cut_short_does_nothing(bench):
    assert bench.send(wire.pack_query()[:2] + b"\xff").heard == []


def test_it_starts_before_it_obeys_and_begins_where_it_is(bench):
    bench.motor.angle = 0.5
    assert bench.demand().servo.mode == STARTING
    bench.go(DT)
    assert (bench.servo.mode, bench.motor.target) == (wire.OBEYS, pytest.approx(0.5))


def test_a_target_moves_with_its_velocity(bench):
    bench.obey(turns=-1.0 / TURN, speed=-2.0 / TURN, torque=-1.5).go(0.02)
    assert bench.motor.target == pytest.approx(0.5 + 0.02)
    assert (bench.motor.target_speed, bench.motor.feed) == pytest.approx((1.0, 3.0))


def test_a_command_keeps_nothing_of_the_one_before(bench):
    bench.obey(turns=-1.0 / TURN, speed=-2.0 / TURN, torque=-1.5, kp=0.5, kd=0.25)
    bench.mode(wire.OBEYS).go(DT)  # only the mode: all else has its default
    motor = bench.motor
    assert (motor.target_speed, motor.feed) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (motor.kp, motor.kd) == pytest.approx((120.0, 5.0))


@pytest.mark.parametrize(
    ("kp", "kd", "gains"),
    [(1.0, 1.0, (120.0, 5.0)), (0.5, 0.25, (60.0, 1.25)), (0.25, 1.0, (30.0, 1.25)), (0.0, 1.0, (0.0, 0.0))],
)
def test_its_damping_is_limited_to_the_share_of_its_stiffness(bench, kp, kd, gains):
    bench.obey(kp=kp, kd=kd).go(DT)
    assert (bench.motor.kp, bench.motor.kd) == pytest.approx(gains)


def test_a_command_is_good_for_its_watchdog_and_a_timeout_is_latched(bench):
    bench.obey(watchdog=0.05).go(0.048)
    assert bench.servo.mode == wire.OBEYS
    bench.go(0.004)
    assert bench.servo.mode == wire.TIMED_OUT
    assert bench.demand().servo.mode == wire.TIMED_OUT
    assert bench.mode(wire.STOPPED).servo.mode == wire.STOPPED
    assert bench.demand().go(2 * DT).servo.mode == wire.OBEYS


@pytest.mark.parametrize(("watchdog", "seconds"), [(0.0, 0.1), (0.3, 0.3)])
def test_without_a_watchdog_of_its_own_a_command_is_good_for_a_tenth_of_a_second(bench, watchdog, seconds):
    bench.obey(watchdog=watchdog).go(seconds - 2 * DT)
    assert bench.servo.mode == wire.OBEYS
    assert bench.go(4 * DT).servo.mode == wire.TIMED_OUT


@pytest.mark.parametrize(("mode", "kd"), [(wire.STOPPED, 0.0), (wire.DAMPS, 5.0), (wire.BRAKES, 5.0)])
def test_after_a_timeout_it_does_what_it_is_configured_for(bench, mode, kd):
    bench.servo.config["servo.timeout_mode"] = float(mode)
    bench.obey(kd=0.1).go(0.2)
    assert (bench.motor.kp, bench.motor.kd) == (0.0, pytest.approx(kd))


def test_a_mode_that_damps_has_a_share_of_the_full_damping_and_no_watchdog(bench):
    bench.obey().demand(wire.DAMPS, kp=0.0, kd=0.6).go(1.0)
    assert (bench.servo.mode, bench.motor.kp, bench.motor.kd) == (wire.DAMPS, 0.0, pytest.approx(3.0))


def test_stopping_takes_the_torque_off(bench):
    bench.obey().mode(wire.STOPPED).go(DT)
    assert (bench.servo.mode, bench.motor.kp, bench.motor.kd) == (wire.STOPPED, 0.0, 0.0)


@pytest.mark.parametrize(("why", "code"), [("overcurrent", 33), ("hot", 38)])
def test_a_fault_is_left_by_a_stop_alone(bench, why, code):
    bench.obey().servo.fail(why)
    bench.demand().go(DT)
    assert (bench.motor.kp, bench.registers[wire.MODE], bench.registers[wire.FAULT]) == (
        0.0,
        wire.FAILED,
        code,
    )
    bench.mode(wire.STOPPED)
    assert (bench.registers[wire.MODE], bench.registers[wire.FAULT]) == (wire.STOPPED, 0)


@pytest.mark.parametrize("mode", [wire.FAILED, wire.TIMED_OUT, 5, 9])
def test_a_mode_that_cannot_be_asked_for_is_not_entered(bench, mode):
    assert bench.mode(mode).servo.mode == wire.STOPPED


def test_diagnostics_read_and_set_values_until_power_off(bench):
    stored = bench.servo.config[KP]
    assert bench.ask(f"conf get {KP}\n") == f"{stored:.6f}\r\n"
    assert bench.ask(f"conf set {KP} 4.5\n") == "OK\r\n"
    assert bench.ask(f"conf get {KP}\n") == "4.500000\r\n"
    bench.servo.boot()
    assert bench.servo.config[KP] == stored


@pytest.mark.parametrize(
    "line", ["conf get servo.nothing\n", "conf set servo.nothing 1\n", "tel stop\n", "\n"]
)
def test_another_line_is_an_error(bench, line):
    assert bench.ask(line) == "ERR unknown\r\n"


def test_a_line_may_come_in_parts_and_its_answer_is_given_once(bench):
    assert bench.ask("conf get servo.pid_po") == ""
    assert bench.ask("sition.ki\n") == "0.000000\r\n"
    assert bench.ask("") == ""


def test_a_servo_that_refuses_says_ok_and_changes_nothing(bench):
    bench.servo.refuse()
    assert bench.ask("conf set servo.timeout_mode 12\n") == "OK\r\n"
    assert bench.servo.config["servo.timeout_mode"] == wire.STOPPED


def test_gains_are_those_of_the_motor_per_turn(bench):
    bench.servo.config[KP] = 10.0
    bench.obey().go(DT)
    assert bench.motor.kp == pytest.approx(10.0 / TURN * 4)  # of the joint, with a ratio of 2


def test_other_tools_get_registers_in_the_type_that_they_ask_for(bench):
    bench.motor.angle = -TURN / 4
    bench.send(bytes([0x14, 2, 0x01]) + b"\x50" * 5)  # two as int16 from 001h on
    (answer,) = wire.unpack(bench.heard[0].data)
    assert (answer.resolution, wire.registers([answer])[wire.POSITION]) == (1, pytest.approx(0.5))
    assert struct.unpack_from("<h", bench.heard[0].data, 3) == (5000,)


def test_its_faults_are_seen(bench):
    bench.servo.pretend()
    assert bench.servo.config[KP] == pytest.approx(12.0 / 4 * TURN)
    bench.servo.warm()
    assert bench.go(1.0).registers[wire.TEMPERATURE] == pytest.approx(50.0)
    bench.servo.encoder.shift(0.1)
    bench.obey(turns=0.0).go(DT)
    assert bench.motor.target == pytest.approx(-0.1)
    bench.servo.cut_short()
    assert len(bench.send(wire.pack_query()).heard[0].data) == 2
    bench.servo.mute()
    assert bench.servo.hears == {}


def test_a_lazy_servo_starts_at_the_fourth_command(bench):
    bench.servo.doze()
    assert [bench.demand().servo.mode for _ in range(4)] == [wire.STOPPED] * 3 + [STARTING]
