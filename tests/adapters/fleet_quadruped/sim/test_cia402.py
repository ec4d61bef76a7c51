"""A simulated CiA 402 drive on its bus: its frames, the targets that it follows, and its watchdog."""

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.cia402 import frames as wire
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.sim.brakes import DAMPING, STIFF
from fleet_quadruped.sim.cia402 import SimDrive
from fleet_quadruped.sim.cia402_dictionary import ERROR_BEHAVIOUR
from fleet_quadruped.sim.world import SimMotor

NODE, DT = 8, 0.002
ENABLED, RUN = 0x1237, 0x0F


class Bench:
    """The drive of a joint, as configured for cycles of 10 ms; its motor is where it is led at once."""

    def __init__(self, dog, *, operational=True):
        self.joint = dog.all_joints[7]
        self.motor, self.heard = SimMotor(angle=0.5), []
        self.drive = SimDrive(self.joint, self.motor, self.heard.append, dog.drive)
        self.units = wire.CountUnits(self.joint)
        self.write({(0x60C2, 1): 10, (0x1016, 1): 0x7F_0064, (0x6007, 0): 3, (0x605A, 0): 6})
        if operational:
            self.nmt(0x01)

    def write(self, values):
        for place, value in values.items():
            self.drive.sdo.objects[place].value = value
        self.drive.sdo.changed = True
        return self

    def send(self, identifier, data=b""):
        if identifier in self.drive.hears:
            self.drive.hears[identifier](CanFrame(identifier, data))
        return self

    def nmt(self, command, node=NODE):
        return self.send(0x000, bytes([command, node]))

    def target(self, word=RUN, angle=0.5, torque=0.0):
        return self.send(wire.RPDO1 + NODE, self.units.pack(word, angle, torque))

    def sync(self):
        return self.send(wire.SYNC)

    def enable(self):
        for word in (0x06, 0x07, RUN):
            self.target(word).sync()
        assert self.drive.state is DriveState.ENABLED
        self.heard.clear()
        return self

    def go(self, seconds):
        for _ in range(round(seconds / DT)):
            self.drive.control(DT)
            if self.motor.kp:
                self.motor.angle = self.motor.target
        return self

    def said(self, base):
        """Return the data of what it sent since the last look."""
        found = [frame.data for frame in self.heard if frame.id == base + NODE]
        self.heard.clear()
        return found


@pytest.fixture
def bench(dog):
    return Bench(dog)


def test_it_boots_up_and_is_then_pre_operational(dog):
    bench = Bench(dog, operational=False)
    assert bench.heard == [CanFrame(0x708, b"\x00")]
    assert bench.target(0x06).sync().said(wire.TPDO1) == []
    assert bench.drive.state is DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("command", "node", "answers"),
    [(0x01, NODE, True), (0x01, 0, True), (0x01, 9, False), (0x02, NODE, False), (0x80, 0, False)],
)
def test_it_answers_a_sync_only_while_it_is_operational(dog, command, node, answers):
    bench = Bench(dog, operational=False).nmt(command, node)
    bench.heard.clear()
    assert bool(bench.sync().said(wire.TPDO1)) == answers


@pytest.mark.parametrize("data", [b"", b"\x80"])
def test_a_short_command_is_ignored(bench, data):
    assert bench.send(0x000, data).sync().said(wire.TPDO1)


@pytest.mark.parametrize("command", [0x81, 0x82])
def test_a_reset_takes_the_torque_off_and_boots_it(bench, command):
    bench.enable().nmt(command)
    assert (bench.said(wire.HEARTBEAT), bench.drive.state) == ([b"\x00"], DriveState.SWITCH_ON_DISABLED)
    assert bench.go(DT).motor.kp == 0


def test_a_master_that_was_heard_before_a_reset_is_not_missed_after_it(bench):
    bench.send(0x77F, b"\x05").nmt(0x81).nmt(0x01).enable().go(0.3)
    assert bench.drive.state is DriveState.ENABLED


def test_a_target_counts_from_the_next_sync_on(bench):
    bench.enable().target(angle=0.6).go(0.02)
    assert bench.motor.angle == pytest.approx(0.5)
    bench.sync().go(0.02)
    assert bench.motor.angle == pytest.approx(0.6, abs=1e-4)


def test_a_target_that_came_before_it_was_operational_is_none(dog):
    bench = Bench(dog, operational=False).target(0x06).nmt(0x01).sync()
    assert bench.drive.state is DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize("command", [0x02, 0x80])
def test_an_enabled_drive_that_is_taken_out_of_operation_stops(bench, command):
    assert bench.enable().nmt(command).drive.state is DriveState.QUICK_STOP


def test_it_interpolates_over_one_cycle(bench):
    bench.enable().target(angle=0.6).sync().go(0.004)
    assert bench.motor.angle == pytest.approx(0.52, abs=0.011)
    assert bench.motor.slope == pytest.approx(10.0, rel=0.01)  # rad/s
    bench.go(0.008)
    assert (bench.motor.angle, bench.motor.slope) == (pytest.approx(0.6, abs=1e-4), 0.0)


def test_an_enabled_drive_is_stiff_and_adds_the_torque_that_it_is_sent(bench):
    bench.enable().target(torque=3.0).sync().go(DT)
    assert (bench.motor.kp, bench.motor.kd) == (STIFF, DAMPING)
    assert bench.motor.feed == pytest.approx(3.0, abs=0.01)


def test_it_is_enabled_where_it_is(bench):
    bench.motor.angle = 0.9  # it was turned by hand
    for word in (0x06, 0x07, RUN):
        bench.target(word, angle=2.0).sync()
    bench.go(DT)
    assert 0.89 < bench.motor.target < 1.2  # it interpolates from there


def test_it_answers_with_its_state_its_angle_and_its_torque(bench):
    bench.motor.torque = 2.0
    bench.enable().sync()
    word, angle, torque = bench.units.unpack(bench.said(wire.TPDO1)[0])
    assert (word, angle, torque) == (ENABLED, pytest.approx(0.5, abs=1e-4), pytest.approx(2.0, abs=0.01))


def test_each_tenth_answer_has_voltage_code_and_temperature_with_it(bench):
    bench.drive.voltage = 44.5
    bench.drive.warm()
    bench.go(2.0).heard.clear()
    for _ in range(20):
        bench.sync()
    slow = [wire.unpack_slow(data) for data in bench.said(wire.TPDO2)]
    assert [(each.voltage, each.code, each.temperature) for each in slow] == [(44.5, 0, 600)] * 2  # 0.1 C


def test_a_model_without_torque_has_short_frames(bench):
    bench.drive.sdo.be_plain()
    assert [len(data) for data in bench.sync().said(wire.TPDO1)] == [6]


def test_a_limited_torque_bounds_how_far_it_pulls(bench):
    bench.enable().write({(0x6072, 0): 100}).target(angle=1.5).sync()  # a tenth of 8 N m
    bench.go(0.01)
    assert bench.motor.target - 0.5 <= 5 * 0.8 / STIFF + 1e-6  # in five steps


def test_its_master_that_falls_silent_stops_it(bench):
    bench.enable().write({ERROR_BEHAVIOUR: 1}).send(0x77F, b"\x05").go(0.09)
    assert (bench.drive.state, bench.heard) == (DriveState.ENABLED, [])
    bench.send(0x77F, b"\x05").go(0.09)
    assert bench.drive.state is DriveState.ENABLED
    bench.go(0.02)
    assert bench.drive.state is DriveState.QUICK_STOP
    assert bench.said(wire.EMERGENCY) == [bytes.fromhex("3081110000000000")]
    bench.go(0.5)
    assert bench.said(wire.EMERGENCY) == []
    bench.target().sync()
    assert bench.drive.state is DriveState.ENABLED  # it is told to go on


def test_a_master_that_never_spoke_is_not_missed(bench):
    assert bench.enable().go(1.0).drive.state is DriveState.ENABLED


@pytest.mark.parametrize(("behaviour", "answers"), [(0, False), (1, True), (2, False)])
def test_after_that_it_is_in_the_state_of_1029h(bench, behaviour, answers):
    bench.write({ERROR_BEHAVIOUR: behaviour}).send(0x77F, b"\x05").go(0.12).heard.clear()
    assert bool(bench.sync().said(wire.TPDO1)) == answers


def test_its_own_heartbeat_has_its_period_and_its_state(bench):
    bench.write({(0x1017, 0): 50}).heard.clear()
    assert bench.go(0.26).said(wire.HEARTBEAT) == [b"\x05"] * 5
    assert bench.nmt(0x80).go(0.1).said(wire.HEARTBEAT) == [b"\x7f"] * 2


def test_a_fault_is_sent_as_an_emergency_and_so_is_its_end(bench):
    bench.enable().drive.fail("overcurrent")
    assert bench.said(wire.EMERGENCY) == [bytes.fromhex("1023210000000000")]
    bench.go(0.3).target(0x80).sync()
    assert bench.said(wire.EMERGENCY) == [bytes(8)]
    assert bench.drive.state is DriveState.SWITCH_ON_DISABLED


def test_a_drive_that_is_cut_short_sends_two_bytes_of_it(bench):
    bench.drive.cut_short()
    assert bench.said(wire.EMERGENCY) == [bytes.fromhex("1023")]


def test_a_drive_that_ignores_its_targets_shows_it_in_bit_12(bench):
    bench.enable().drive.ignore()
    bench.target(angle=0.9).sync().go(0.02)
    assert bench.units.unpack(bench.said(wire.TPDO1)[0])[0] == ENABLED & ~0x1000
    assert bench.motor.angle == pytest.approx(0.5)


def test_a_mute_drive_neither_hears_nor_says_anything(bench):
    bench.enable().drive.mute()
    bench.drive.boot()
    assert (bench.drive.hears, bench.heard) == ({}, [])


def test_an_encoder_that_is_off_is_off_in_what_it_says_and_where_it_goes(bench):
    bench.enable().drive.encoder.shift(0.1)
    bench.target(angle=0.5).sync().go(0.02)
    assert bench.motor.angle == pytest.approx(0.4, abs=1e-4)
    bench.sync()
    assert bench.units.unpack(bench.said(wire.TPDO1)[-1])[1] == pytest.approx(0.5, abs=1e-4)


@pytest.mark.parametrize("data", [b"", b"\x0f\x00", bytes(5)])
def test_a_short_target_is_none(bench, data):
    bench.enable().send(wire.RPDO1 + NODE, data).sync().go(0.02)
    assert (bench.drive.state, bench.motor.angle) == (DriveState.ENABLED, pytest.approx(0.5))
