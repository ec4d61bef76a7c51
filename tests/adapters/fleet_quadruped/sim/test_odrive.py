"""A simulated ODrive: what it answers and obeys, the watchdog that positions feed, and its parameters."""

import math
import struct

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State
from fleet_quadruped.robot.parts import Drive, Endpoints
from fleet_quadruped.sim.odrive import SimOdrive
from fleet_quadruped.sim.world import SimMotor

NODE, DT, TURN = 3, 0.002, math.tau
ENABLE, TIMEOUT = 241, 242


class Bench:
    """A drive with a ratio of 2 that is turned around, and what it sent."""

    def __init__(self, joint_of, *, endpoints=True):
        given = Endpoints(enable_watchdog=ENABLE, watchdog_timeout=TIMEOUT) if endpoints else None
        drive = Drive(protocol="odrive", timeout=0.1, endpoints=given)
        self.motor, self.heard = SimMotor(), []
        self.drive = SimOdrive(
            joint_of(number=NODE, sign=-1, ratio=2.0), self.motor, self.heard.append, drive
        )

    def send(self, command, data=b"", *, remote=False):
        self.heard.clear()
        identifier = wire.identifier(NODE, command)
        if identifier in self.drive.hears:
            self.drive.hears[identifier](CanFrame(identifier, data, remote=remote))
        return self

    def ask(self, command):
        """Return the data that it answers to a request."""
        (frame,) = self.send(command, remote=True).heard
        assert wire.split(frame.id) == (NODE, command)
        return frame.data

    def state(self, state):
        return self.send(OdriveCommand.STATE, wire.pack_state(state))

    def arm(self):
        self.send(OdriveCommand.MODES, wire.pack_modes()).state(State.CLOSED_LOOP)
        assert self.drive.state == State.CLOSED_LOOP
        return self

    def target(self, angle=0.0, speed=0.0, torque=0.0):
        """Send a position of the motor, rad."""
        return self.send(OdriveCommand.INPUT_POS, wire.pack_input(angle, speed, torque))

    def watch(self, seconds):
        self.send(OdriveCommand.PARAMETER, wire.write_parameter(TIMEOUT, struct.pack("<f", seconds)))
        return self.send(OdriveCommand.PARAMETER, wire.write_parameter(ENABLE, b"\x01"))

    def go(self, seconds):
        for _ in range(round(seconds / DT)):
            self.drive.control(DT)
        return self


@pytest.fixture
def make(joint_of):
    return lambda **how: Bench(joint_of, **how)


@pytest.fixture
def bench(make):
    return make()


def test_it_tells_what_it_measures_on_request_alone(bench):
    bench.motor.angle, bench.motor.speed, bench.motor.torque = 0.5, -1.0, 3.0
    assert wire.unpack_pair(bench.ask(OdriveCommand.ESTIMATES)) == pytest.approx((-1.0 / TURN, 2.0 / TURN))
    assert wire.unpack_pair(bench.ask(OdriveCommand.TORQUES)) == pytest.approx((-1.5, -1.5))
    assert wire.unpack_pair(bench.ask(OdriveCommand.SUPPLY)) == pytest.approx((48.0, 3.0))
    assert (
        wire.warmest(bench.ask(OdriveCommand.TEMPERATURE)) == 40.0
    )  # that of its transistors: no thermistor
    assert wire.unpack_version(bench.ask(OdriveCommand.VERSION)) == (0, 6)
    bench.heard.clear()
    assert bench.go(0.09).heard == []


def test_each_drive_has_a_serial_number_of_its_own(make):
    one, other = (make().ask(OdriveCommand.ADDRESS) for _ in range(2))
    assert (one[0], len(one)) == (NODE, 8)
    assert one[1:7] != other[1:7]


def test_its_heartbeat_comes_ten_times_a_second_with_state_and_errors(bench):
    bench.arm().drive.fail("overcurrent")
    bench.heard.clear()
    beats = [frame.data for frame in bench.go(1.0).heard]
    assert len(beats) in {9, 10}
    assert wire.unpack_heartbeat(beats[-1]) == (1 << 10, State.IDLE)


def test_no_command_is_acknowledged(bench):
    assert bench.arm().heard == []
    assert bench.target().heard == []
    assert bench.watch(0.1).heard == []


def test_it_is_armed_where_it_is(bench):
    bench.motor.angle = 0.5
    bench.arm().go(DT)
    assert bench.motor.target == pytest.approx(0.5)


def test_an_armed_drive_follows_its_positions_with_its_gains(bench):
    bench.send(OdriveCommand.POS_GAIN, wire.pack_gain(10.0))
    bench.send(OdriveCommand.VEL_GAINS, wire.pack_pair(0.5 * TURN, 0.0))
    bench.arm().target(-1.0, 2.0, -1.5).go(DT)
    assert bench.motor.target == pytest.approx(0.5)
    assert (bench.motor.target_speed, bench.motor.feed) == pytest.approx((-1.0, 3.0), abs=0.005)
    assert (bench.motor.kp, bench.motor.kd) == pytest.approx((10.0 * 0.5 * 4, 0.5 * 4))


def test_its_gains_are_those_of_the_factory_again_after_power_off(bench):
    bench.send(OdriveCommand.POS_GAIN, wire.pack_gain(10.0)).drive.boot()
    bench.arm().go(DT)
    assert bench.motor.kp / bench.motor.kd == pytest.approx(20.0)
    assert bench.motor.kd == pytest.approx(1 / 6 / TURN * 4)


def test_positions_are_obeyed_in_the_mode_that_passes_them_through(bench):
    bench.state(State.CLOSED_LOOP).target(-1.0).go(DT)
    assert bench.motor.target == 0.0
    bench.send(OdriveCommand.MODES, wire.pack_modes()).target(-1.0).go(DT)
    assert bench.motor.target == pytest.approx(0.5)


def test_a_position_that_is_no_number_is_not_followed(bench):
    bench.arm().target(-1.0)
    bench.send(OdriveCommand.INPUT_POS, struct.pack("<fhh", math.nan, 0, 0)).go(DT)
    assert bench.motor.target == pytest.approx(0.5)


@pytest.mark.parametrize("data", [b"", b"\x08\x00\x00"])
def test_a_short_state_is_none(bench, data):
    assert bench.send(OdriveCommand.STATE, data).drive.state == State.IDLE


@pytest.mark.parametrize(
    "command", [OdriveCommand.POS_GAIN, OdriveCommand.VEL_GAINS, OdriveCommand.PARAMETER]
)
def test_a_short_command_changes_nothing(bench, command):
    bench.arm().send(command, b"\x00").go(DT)
    assert bench.motor.kp == pytest.approx(20 / 6 / TURN * 4)


def test_idle_takes_the_torque_off(bench):
    bench.arm().state(State.IDLE).go(DT)
    assert (bench.motor.kp, bench.motor.kd) == (0.0, 0.0)


def test_the_watchdog_is_off_until_it_is_enabled(bench):
    bench.send(OdriveCommand.PARAMETER, wire.write_parameter(TIMEOUT, struct.pack("<f", 0.1)))
    assert bench.drive.watchdog == math.inf
    assert bench.arm().go(1.0).drive.state == State.CLOSED_LOOP
    assert bench.watch(0.25).drive.watchdog == pytest.approx(0.25)


def test_only_positions_feed_the_watchdog(bench):
    bench.watch(0.1).arm().go(0.09).target().go(0.09)
    assert bench.drive.state == State.CLOSED_LOOP
    bench.send(OdriveCommand.POS_GAIN, wire.pack_gain(10.0)).ask(OdriveCommand.ESTIMATES)
    bench.go(0.02)
    assert (bench.drive.state, bench.drive.errors) == (State.IDLE, wire.WATCHDOG_EXPIRED)
    assert bench.motor.kp == 0.0


def test_an_expired_watchdog_keeps_it_disarmed_until_its_errors_are_cleared(bench):
    bench.watch(0.1).arm().go(0.2).state(State.CLOSED_LOOP)
    assert bench.drive.state == State.IDLE
    bench.send(OdriveCommand.CLEAR).state(State.CLOSED_LOOP)
    assert (bench.drive.state, bench.drive.errors) == (State.CLOSED_LOOP, 0)
    assert bench.go(0.09).drive.state == State.CLOSED_LOOP, "its time begins anew"


def test_an_armed_drive_is_not_armed_anew(bench):
    bench.watch(0.1).arm().go(0.09).state(State.CLOSED_LOOP).go(0.02)
    assert bench.drive.state == State.IDLE


@pytest.mark.parametrize("why", ["overcurrent", "hot"])
def test_a_fault_disarms_it(bench, why):
    bench.arm().drive.fail(why)
    bench.state(State.CLOSED_LOOP).go(DT)
    assert (bench.drive.state, bench.motor.kp) == (State.IDLE, 0.0)


def test_a_parameter_is_read_as_it_was_written_until_power_off(bench):
    bench.watch(0.25).send(OdriveCommand.PARAMETER, wire.read_parameter(TIMEOUT))
    assert [(wire.split(frame.id)[1], frame.data) for frame in bench.heard] == [
        (OdriveCommand.TX_SDO, struct.pack("<BHxf", 0, TIMEOUT, 0.25))
    ]
    bench.drive.boot()
    assert bench.drive.watchdog == math.inf


def test_a_parameter_that_it_does_not_have_is_not_answered(bench):
    assert bench.send(OdriveCommand.PARAMETER, wire.read_parameter(99)).heard == []


def test_a_drive_that_refuses_keeps_what_it_had(bench):
    bench.drive.refuse()
    assert bench.watch(0.1).drive.watchdog == math.inf


def test_without_endpoints_a_person_has_set_its_watchdog(make):
    bench = make(endpoints=False).arm()
    assert bench.drive.watchdog == 0.1
    assert bench.go(0.11).drive.errors == wire.WATCHDOG_EXPIRED


def test_its_faults_are_seen(bench):
    bench.drive.pretend()
    assert wire.unpack_version(bench.ask(OdriveCommand.VERSION)) == (0, 5)
    bench.drive.warm()
    assert wire.warmest(bench.go(1.0).ask(OdriveCommand.TEMPERATURE)) == pytest.approx(50.0)
    bench.drive.encoder.shift(0.1)
    bench.arm().target(-1.0).go(DT)
    assert bench.motor.target == pytest.approx(0.4)
    bench.drive.cut_short()
    assert len(bench.ask(OdriveCommand.SUPPLY)) == 2
    bench.drive.mute()
    bench.heard.clear()
    assert (bench.drive.hears, bench.go(1.0).heard) == ({}, [])


def test_a_lazy_drive_is_armed_at_the_fourth_request(bench):
    bench.drive.doze()
    assert [bench.state(State.CLOSED_LOOP).drive.state for _ in range(4)] == [State.IDLE] * 3 + [
        State.CLOSED_LOOP
    ]
