"""What a self-walking machine says of itself: mode, error, velocity, battery; and where it went."""

import math

import pytest

from fleet import CanFrame
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.frames import encode
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.telemetry import Telemetry


class Machine:
    """The telemetry of a machine, and what it says."""

    def __init__(self, walker):
        self.walker, self.telemetry = walker, Telemetry(walker)

    def number(self, mode):
        return next(number for number, meant in self.walker.modes.items() if meant is mode)

    def say(self, now=0.0, *, bus=None, **values):
        for frame in (*self.walker.wire.state, *self.walker.wire.slow):
            if set(frame.fields) & set(values) or frame in self.walker.wire.state:
                data = CanFrame(frame.id, encode(frame, values))
                self.telemetry.handle_frame(bus or self.walker.bus, data, now)
        return self

    def update(self, now=0.0, dt=0.02):
        self.telemetry.update(now, dt)
        return self.telemetry


@pytest.fixture
def machine(walker):
    return Machine(walker)


def test_a_machine_that_said_nothing_is_off_and_stale(machine):
    telemetry = machine.update(5.0)
    assert (telemetry.mode, telemetry.is_stale, telemetry.age(5.0)) == (BodyMode.OFF, True, math.inf)
    assert (telemetry.twist, telemetry.battery, telemetry.percent) == (Twist(), {}, None)
    assert (telemetry.x, telemetry.y, telemetry.yaw) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("mode", [BodyMode.OFF, BodyMode.STANDING])
def test_its_mode_is_what_its_number_means(machine, mode):
    telemetry = machine.say(mode=machine.number(mode)).update()
    assert (telemetry.mode, telemetry.unnamed) == (mode, "")


def test_a_mode_that_is_not_described_is_told_and_is_no_posture(machine):
    unknown = max(machine.walker.modes) + 1
    telemetry = machine.say(mode=unknown).update()
    words = f"it reports mode {unknown}, which is not in modes"
    assert (telemetry.mode, telemetry.unnamed) == (BodyMode.UNKNOWN, words)
    telemetry = machine.say(mode=machine.number(BodyMode.STANDING)).update()
    assert telemetry.unnamed == ""


def test_an_error_is_told_in_words_and_by_its_number(machine):
    number, words = next(iter(machine.walker.errors.items()))
    assert machine.say(error=number).update().error == f"{words} (error {number})"
    unknown = max(machine.walker.errors) + 1
    assert machine.say(error=unknown).update().error == f"error (error {unknown})"
    assert machine.say(error=0).update().error == ""


def test_what_is_stale_changes_nothing(machine):
    standing = machine.number(BodyMode.STANDING)
    telemetry = machine.say(1.0, mode=standing, x=0.5).update(1.0)
    x, late = telemetry.x, 1.0 + machine.walker.timeout
    machine.update(late - 0.001)
    assert not telemetry.is_stale
    assert telemetry.x > x
    x = telemetry.x
    machine.update(late + 0.001)
    assert (telemetry.is_stale, telemetry.x, telemetry.mode) == (True, x, BodyMode.STANDING)
    assert telemetry.age(late) == pytest.approx(machine.walker.timeout)


def test_what_other_nodes_and_other_buses_say_is_ignored(machine):
    standing = machine.number(BodyMode.STANDING)
    machine.telemetry.handle_frame(machine.walker.bus, CanFrame(0x7E1, bytes(8)), 1.0)
    machine.say(1.0, bus="z", mode=standing)
    assert machine.update(1.0).mode is BodyMode.OFF
    assert machine.telemetry.is_stale


def test_where_it_went_is_its_velocity_over_time_in_the_direction_of_its_nose(machine):
    for cycle in range(100):
        machine.say(0.02 * cycle, x=0.5, y=0.25).update(0.02 * cycle)
    telemetry = machine.telemetry
    straight = telemetry.x, telemetry.y
    assert math.hypot(*straight) == pytest.approx(2.0 * math.hypot(0.5, 0.25), rel=0.02)
    bearing = math.atan2(straight[1], straight[0]) - telemetry.yaw
    assert bearing == pytest.approx(math.atan2(0.25, 0.5), abs=0.02)


def test_its_velocity_is_what_it_reports(machine):
    twist = machine.say(x=0.4, y=-0.1, turn=0.6).update().twist
    assert (twist.x, twist.y, twist.turn) == pytest.approx((0.4, -0.1, 0.6), abs=0.01)


def test_its_attitude_has_the_heading_of_its_odometry(machine):
    telemetry = machine.say(turn=0.5).update()
    assert telemetry.rotation.yaw == pytest.approx(telemetry.yaw, abs=1e-3)


def test_the_level_of_its_battery_is_known_while_it_is_fresh(machine):
    most = machine.walker.slow_timeout
    telemetry = machine.say(1.0, percent=55.0).update(1.0)
    assert telemetry.percent == pytest.approx(55.0, abs=0.5)
    assert telemetry.battery["percent"] == pytest.approx(55.0, abs=0.5)
    assert telemetry.battery_age(2.5) == pytest.approx(1.5)
    assert machine.update(1.0 + most - 0.1).percent is not None
    assert machine.update(1.0 + most + 0.1).percent is None
    assert telemetry.battery, "the last values stay known, with their age"


def test_a_battery_that_said_nothing_has_no_age(machine):
    assert machine.telemetry.battery_age(5.0) is None
