"""One ODrive: what it says of itself, when it is not trusted, and what is sent to it."""

import math

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.drives.odrive import frames
from fleet_quadruped.drives.odrive.axis import OdriveAxis
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State

IDLE, CLOSED_LOOP = State.IDLE, State.CLOSED_LOOP


class Bench:
    """An ODrive of a joint with a ratio of 2 that is turned around, and what it says."""

    def __init__(self, joint_of, wire):
        joint = joint_of(number=7, sign=-1, ratio=2.0)
        self.axis, self.wire = OdriveAxis(joint, wire, 7, Units(joint), b"", b""), wire

    def say(self, command, data, now=1.0):
        self.axis.handle_data(command, data, now)
        return self

    def beat(self, state=CLOSED_LOOP, errors=0, now=1.0):
        return self.say(OdriveCommand.HEARTBEAT, frames.pack_heartbeat(errors, state), now)

    def estimate(self, turns=0.0, speed=0.0, now=1.0):
        return self.say(OdriveCommand.ESTIMATES, frames.pack_pair(turns, speed), now)

    def power(self, now=1.0):
        return self.axis.power(now)


@pytest.fixture
def bench(joint_of, wire):
    return Bench(joint_of, wire)


def test_turns_of_the_motor_are_radians_of_the_joint(bench):
    axis = bench.estimate(1.0, -0.5, now=3.0).axis
    assert axis.angle == pytest.approx(-math.pi)
    assert axis.speed == pytest.approx(math.pi / 2)
    assert (axis.reported_at, axis.answers.complete) == (3.0, True)


def test_a_torque_is_that_of_the_joint_as_it_is_estimated(bench):
    assert bench.say(OdriveCommand.TORQUES, frames.pack_pair(9.0, 1.5)).axis.torque == pytest.approx(-3.0)


def test_temperature_and_voltage_are_as_they_are_said(bench):
    bench.say(OdriveCommand.TEMPERATURE, frames.pack_pair(40.0, 55.0))
    bench.say(OdriveCommand.SUPPLY, frames.pack_pair(24.5, 1.0))
    assert (bench.axis.temperature, bench.axis.voltage) == (55.0, 24.5)


@pytest.mark.parametrize("command", [*OdriveCommand, 0x1F])
@pytest.mark.parametrize("data", [b"", b"\x01", b"\x01\x02\x03"])
def test_what_is_cut_short_or_unknown_changes_nothing(bench, command, data):
    bench.estimate(0.3, 0.1).beat().say(OdriveCommand.SUPPLY, frames.pack_pair(24.5, 1.0))
    before = bench.axis.angle, bench.axis.state, bench.axis.voltage, bench.axis.reported_at, bench.axis.torque
    bench.say(command, data, now=9.0)
    axis = bench.axis
    assert (axis.angle, axis.state, axis.voltage, axis.reported_at, axis.torque) == before
    assert (axis.version, axis.serials, axis.parameters) == (None, set(), {})


def test_a_version_an_address_and_parameters_are_kept(bench):
    bench.say(OdriveCommand.VERSION, frames.pack_version(0, 6)).say(OdriveCommand.VERSION, b"")
    bench.say(OdriveCommand.ADDRESS, b"\x07ABCDEF\0")
    answer = frames.write_parameter(241, b"\x01\0\0\0")
    bench.say(OdriveCommand.TX_SDO, answer)
    assert bench.axis.version == (0, 6)
    assert bench.axis.serials == {b"ABCDEF"}
    assert bench.axis.parameters == {241: b"\x01\0\0\0"}


def test_a_drive_is_absent_until_it_has_told_its_angle_and_its_state(bench, joint_of, wire):
    assert bench.power() == (Power.ABSENT, "")
    assert bench.beat().power() == (Power.ABSENT, "")
    assert Bench(joint_of, wire).estimate().power() == (Power.ABSENT, "")
    assert bench.estimate().power()[0] is not Power.ABSENT


@pytest.mark.parametrize(
    ("wanted", "state", "power"),
    [
        (Power.ENABLED, CLOSED_LOOP, Power.ENABLED),
        (Power.STOPPING, CLOSED_LOOP, Power.STOPPING),
        (Power.DISABLED, CLOSED_LOOP, Power.STOPPING),
        (Power.ENABLED, IDLE, Power.DISABLED),
        (Power.ENABLED, State.UNDEFINED, Power.DISABLED),
    ],
)
def test_a_drive_in_closed_loop_is_what_it_should_be_and_any_other_is_off(bench, wanted, state, power):
    bench.axis.wanted = wanted
    assert bench.beat(state).estimate().power() == (power, "")


@pytest.mark.parametrize("state", [2, 3, 7, 9, 13])
def test_a_drive_that_moves_by_itself_is_a_fault(bench, state):
    words = f"id 7 is in state {state}, in which it moves its motor by itself"
    assert bench.beat(state).estimate().power() == (Power.FAULT, words)


def test_errors_are_told_in_words_and_as_their_number(bench):
    bench.beat(IDLE, 1 << 9 | 1 << 13).estimate()
    assert bench.power() == (Power.FAULT, "under-voltage, motor over temperature (active errors 2200h)")
    assert bench.beat(IDLE).power() == (Power.DISABLED, "")


def test_a_drive_whose_heartbeat_is_missing_is_a_fault_after_035_s(bench):
    bench.axis.wanted = Power.ENABLED
    bench.beat(now=1.0).estimate(now=1.3)
    assert bench.power(1.34) == (Power.ENABLED, "")
    assert bench.power(1.36) == (Power.FAULT, "no heartbeat (command 01h) from id 7 for 0.36 s")


def test_two_drives_with_one_id_are_told_by_their_serial_numbers(bench):
    bench.beat().estimate()
    for _ in range(2):
        bench.say(OdriveCommand.ADDRESS, b"\x07ABCDEF\0")
    assert bench.power()[0] is not Power.FAULT
    bench.say(OdriveCommand.ADDRESS, b"\x07ABCDEG\0")
    assert bench.power() == (Power.FAULT, "two drives answer as id 7 on bus a: give each its own")


def test_a_drive_that_lets_go_without_an_error_has_restarted(bench):
    bench.axis.wanted = Power.ENABLED
    bench.beat(CLOSED_LOOP).estimate().beat(IDLE)
    words = "id 7 switched its torque off (state 1); it is configured again after a reset"
    assert bench.power() == (Power.FAULT, words)


def test_a_drive_that_lets_go_for_an_error_has_that_error_and_is_not_restarted(bench):
    bench.axis.wanted = Power.ENABLED
    bench.beat(CLOSED_LOOP).estimate().beat(IDLE, errors=1 << 24)
    assert bench.power() == (Power.FAULT, "our frames did not reach the drive (active errors 1000000h)")
    assert not bench.axis.restarted


def test_a_drive_stays_where_it_says_that_it_is_and_one_that_says_nothing_is_told_nothing(bench, wire):
    bench.axis.stay()
    assert wire.sent == []
    bench.estimate(1.25)
    bench.axis.stay()
    (frame,) = wire.sent
    assert frame.id == frames.identifier(7, OdriveCommand.INPUT_POS)
    angle, speed, torque = frames.unpack_input(frame.data)
    assert angle == pytest.approx(1.25 * math.tau)
    assert (speed, torque) == (0.0, 0.0)


def test_what_is_sent_has_the_identifier_of_the_node_and_the_command(bench, wire):
    bench.axis.send(OdriveCommand.CLEAR, b"\0")
    assert wire.sent == [CanFrame(7 << 5 | 0x18, b"\0")]
