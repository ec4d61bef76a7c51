"""Moving one joint on the bench: what moves, how hard, and that it always ends with the torque off."""

import os
import signal
import sys
import threading

import click.testing
import pytest

from fleet.errors import Fault, LinkLost, LinkRefused, Refused
from fleet.testing.clock import ManualClock
from fleet_quadruped.cli import can
from fleet_quadruped.drives.cia402.frames import RPDO1
from fleet_quadruped.drives.cia402.setup import MAX_TORQUE
from fleet_quadruped.jog import SPEED, AbortInput, Jog, Jogger, JogStopped, ramp, verdict
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.sim.lockstep import SimBus, lockstep

NUMBER = JOINTS.index("FR_hip")


class Wall:
    """A simulated dog on the bench: time passes while a bus is read."""

    def __init__(self, dog, step=0.06, torque=2.4):
        self.sim, buses = lockstep(dog)
        self.clock = ManualClock()
        self.pressed_at = None
        self.during_motion = lambda: None
        self.hardest = 0.0
        self.start = self.motor.angle
        self.bus = buses["a"]
        self.bus.receive = self._receive
        self.jogger = Jogger(dog, buses, self.clock, Jog(dog.all_joints[NUMBER], step, torque), self.pressed)

    def _receive(self, wait):
        if threading.current_thread() is not threading.main_thread():
            return SimBus.receive(self.bus, wait)  # canopen waits for answers
        frames = SimBus.receive(self.bus, 0.0)
        self.clock.advance(0.002)
        if hasattr(self, "jogger"):
            self.sim.advance(0.002)
            motor = self.motor
            if motor.kp:
                self.hardest = max(self.hardest, abs(motor.kp * (motor.target - motor.angle)))
        return frames

    @property
    def motor(self):
        return self.sim.world.motors[NUMBER]

    def pressed(self):
        if abs(self.motor.angle - self.start) > 0.02:
            self.during_motion()
        return self.pressed_at is not None and abs(self.motor.angle - self.start) > self.pressed_at

    def off(self):
        self.sim.advance(0.002)
        return self.motor.kp == self.motor.kd == 0


@pytest.fixture
def wall(any_dog):
    return Wall(any_dog)


def test_only_the_one_joint_moves_and_is_off_afterwards(wall):
    before = [motor.angle for motor in wall.sim.world.motors]
    assert wall.jogger.move() == pytest.approx(0.06, abs=0.01)
    moved = [abs(motor.angle - angle) for motor, angle in zip(wall.sim.world.motors, before, strict=True)]
    assert moved.pop(NUMBER) == pytest.approx(0.06, abs=0.01)
    assert max(moved) == 0.0
    assert wall.off()


def test_it_never_pushes_harder_than_it_may(any_dog):
    wall = Wall(any_dog, step=0.1, torque=0.5)
    wall.jogger.move()
    assert 0 < wall.hardest <= 0.55


def test_a_key_stops_it_at_once(wall):
    wall.pressed_at = 0.02
    with pytest.raises(JogStopped):
        wall.jogger.move()
    assert abs(wall.motor.angle - wall.start) < 0.03
    assert wall.off()


def test_a_drive_that_fails_ends_it(wall):
    wall.during_motion = lambda: wall.sim.fault("overcurrent", NUMBER + 1)
    with pytest.raises(Fault, match="FR_hip"):
        wall.jogger.move()
    assert wall.off()


def test_a_drive_that_falls_silent_ends_it(wall):
    wall.during_motion = lambda: wall.sim.fault("mute", NUMBER + 1)
    with pytest.raises(LinkLost, match=r"FR_hip: .*silent"):
        wall.jogger.move()


def test_a_torque_limit_that_could_not_be_taken_back_is_reported(dog, caplog):
    wall = Wall(dog)
    wall.during_motion = lambda: wall.sim.fault("mute", NUMBER + 1)
    with pytest.raises(LinkLost):
        wall.jogger.move()
    assert "FR_hip: its torque is still limited; switch its power off and on" in caplog.text


def test_a_silent_drive_is_not_moved(wall):
    wall.sim.fault("mute", NUMBER + 1)
    with pytest.raises((Refused, LinkLost), match=r"FR_hip: id 5 on bus 'a' (is silent|does not answer)"):
        wall.jogger.move()


def test_a_step_out_of_the_limits_is_refused(any_dog):
    with pytest.raises(Refused, match=r"FR_hip: .* is outside"):
        Wall(any_dog, step=4.0).jogger.move()


def test_a_drive_whose_torque_cannot_be_limited_is_not_moved(dog):
    wall = Wall(dog)
    del wall.sim.drives[NUMBER].sdo.objects[MAX_TORQUE]
    with pytest.raises(LinkRefused, match=r"FR_hip: 6072h:0"):
        wall.jogger.move()
    assert wall.off()


def test_the_drive_has_its_own_torque_limit_back(dog):
    wall = Wall(dog)
    wall.sim.drives[NUMBER].sdo.objects[MAX_TORQUE].value = 1234
    wall.jogger.move()
    assert wall.sim.drives[NUMBER].sdo.objects[MAX_TORQUE].value == 1234


def test_other_drives_are_sent_nothing(dog):
    wall = Wall(dog)
    wall.jogger.move()
    ids = {frame.id for frame in wall.bus.sent}
    assert ids & {RPDO1 + joint.id for joint in dog.all_joints} == {RPDO1 + dog.all_joints[NUMBER].id}


@pytest.mark.parametrize("step", [0.05, -0.17])
def test_the_way_is_slow(step):
    targets = list(ramp(1.0, step, 0.01))
    assert targets[-1] == pytest.approx(1.0 + step)
    steps = [abs(after - before) for before, after in zip([1.0, *targets], targets, strict=False)]
    assert max(steps) <= SPEED * 0.01 + 1e-9


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP])
def test_a_signal_ends_it_in_order_and_the_next_one_does_not_cut_the_braking_short(wall, monkeypatch, number):
    source, _ = ends = os.pipe()
    before = signal.getsignal(number)
    monkeypatch.setattr(sys, "stdin", os.fdopen(source, closefd=False))
    pressed = wall.jogger._interrupted = AbortInput()
    wall.during_motion = lambda: os.kill(os.getpid(), number)
    looked, braked = wall.jogger._cycle, wall.jogger._bench.drives.quick_stop
    wall.jogger._cycle = lambda act: (wall.pressed(), looked(act))[1]
    wall.jogger._bench.drives.quick_stop = lambda: (os.kill(os.getpid(), number), braked())
    with pressed.watching(), pytest.raises(JogStopped):
        wall.jogger.move()
    assert wall.off()
    assert signal.getsignal(number) is before
    for end in ends:
        os.close(end)


def test_a_sign_that_is_turned_over_asks_for_a_new_calibration(dog):
    hip = dog.all_joints[NUMBER]
    assert verdict(hip, right=True) == "sign: -1"
    assert verdict(hip, right=False).startswith("sign: 1; then calibrate again")


@pytest.mark.parametrize(("option", "value"), [("--degrees", "nan"), ("--degrees", "0"), ("--torque", "nan")])
def test_a_step_that_nobody_sees_or_that_is_no_number_is_refused(option, value):
    line = ["jog", str(EXAMPLE), "--joint", "FR_hip", option, value]
    result = click.testing.CliRunner().invoke(can, line, standalone_mode=False)
    assert isinstance(result.exception, LinkRefused)
