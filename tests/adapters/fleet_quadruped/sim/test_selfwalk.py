"""A simulated machine that walks by itself: its modes, its velocity, and when it stands still."""

import math

import pytest

from fleet import CanFrame
from fleet_quadruped.frames import encode
from fleet_quadruped.safety.stages import BodyMode
from tests.adapters.fleet_quadruped.sim.walker_benches import DT, OWN, Bench


@pytest.fixture
def bench():
    return Bench()


def test_it_stands_up_and_sits_down_in_a_second(bench):
    assert bench.command("stand_up").mode is BodyMode.RISING
    assert bench.go(0.9).mode is BodyMode.RISING
    assert bench.go(0.2).mode is BodyMode.STANDING
    assert bench.command("sit_down").mode is BodyMode.SITTING
    assert bench.go(1.1).mode is BodyMode.OFF


@pytest.mark.parametrize("command", ["sit_down", "emergency_stop", "reset_faults"])
def test_one_that_lies_has_nothing_to_sit_down_or_to_stop(bench, command):
    assert bench.command(command).mode is BodyMode.OFF


@pytest.mark.parametrize("before", [["stand_up"], ["stand_up", "sit_down"], ["recovery_stand"]])
def test_an_emergency_stop_lowers_it_whatever_it_does(bench, before):
    for command in before:
        bench.command(command)
    assert bench.command("emergency_stop").mode is BodyMode.DAMPED
    assert bench.command("stand_up").command("sit_down").mode is BodyMode.DAMPED
    assert bench.go(1.1).mode is BodyMode.OFF


def test_it_gets_up_from_its_back_by_a_recovery(bench):
    assert bench.command("recovery_stand").mode is BodyMode.RECOVERING
    assert bench.go(1.6).mode is BodyMode.RISING
    assert bench.go(1.1).mode is BodyMode.STANDING


def test_it_follows_a_velocity_with_its_lag_and_reports_it(bench):
    bench.stand().drive(0.5, 0.2, -0.3, seconds=0.1)
    assert 0.25 < bench.machine.twist.x < 0.4
    bench.drive(0.5, 0.2, -0.3, seconds=0.9)
    assert tuple(bench.machine.twist) == pytest.approx((0.5, 0.2, -0.3), abs=0.01)
    assert bench.mode is BodyMode.WALKING
    said = bench.said()
    assert (said["x"], said["y"], said["turn"], said["mode"]) == pytest.approx((0.5, 0.2, -0.3, 3), abs=0.01)


def test_it_moves_where_it_is_headed(bench):
    bench.machine.place = (1.0, 2.0, math.pi / 2)
    bench.stand().drive(0.5, seconds=2.0)
    x, y, yaw = bench.machine.place
    assert (x, yaw) == pytest.approx((1.0, math.pi / 2))
    assert y == pytest.approx(2.0 + 0.5 * 1.9, abs=0.03)


def test_without_a_velocity_it_stands_still_after_its_silence(bench):
    bench.stand().drive(0.5, seconds=1.0).go(OWN.silence - 2 * DT)
    assert bench.machine.twist.x == pytest.approx(0.5, abs=0.01)
    bench.go(1.0)
    assert (tuple(bench.machine.twist), bench.mode) == (pytest.approx((0, 0, 0), abs=0.01), BodyMode.STANDING)


def test_one_that_lies_does_not_walk(bench):
    bench.drive(0.5, seconds=1.0)
    assert (tuple(bench.machine.twist), bench.machine.place, bench.mode) == (
        (0, 0, 0),
        (0, 0, 0),
        BodyMode.OFF,
    )


@pytest.mark.parametrize("length", [6, 7])
def test_a_velocity_of_another_length_is_none(bench, length):
    (frame,) = OWN.wire.velocity
    data = encode(frame, {"x": 0.5, "y": 0.0, "turn": 0.0})[:length]
    bench.stand().send(CanFrame(frame.id, data)).go(0.2)
    assert bench.machine.twist.x == 0.0


def test_a_height_is_taken(bench):
    assert bench.send(OWN.wire.height(0.25)).machine.height == 0.25


def test_its_state_comes_in_each_cycle_and_its_battery_once_a_second(bench):
    bench.go(2.0)
    ids = [frame.id for frame in bench.heard]
    assert (ids.count(0x211), ids.count(0x221), ids.count(0x361)) == (100, 100, 2)
    bench.heard.clear()
    bench.machine.advance(DT, sense=False)
    assert bench.heard == []


@pytest.mark.parametrize(
    ("fault", "value", "told"), [("battery", 8.0, {"percent": 8.0}), ("error", 2.0, {"error": 2.0})]
)
def test_a_fault_is_told(bench, fault, value, told):
    bench.machine.fault(fault, value)
    assert told.items() <= bench.go(1.1).said().items()


def test_an_error_lets_it_stand_until_it_is_reset(bench):
    bench.stand().machine.fault("error", 2)
    bench.drive(0.5, seconds=0.5)
    assert bench.machine.twist.x == 0.0
    bench.command("reset_faults").drive(0.5, seconds=0.5)
    assert bench.machine.twist.x > 0.4
    assert bench.said()["error"] == 0


def test_one_that_ignores_its_velocities_stands_or_runs(bench):
    bench.stand().machine.fault("idle")
    assert bench.drive(0.5, seconds=1.0).machine.twist.x == 0.0
    bench.machine.fault("runs")
    assert bench.drive(0.0, seconds=1.0).machine.twist.x == pytest.approx(0.5, abs=0.01)


def test_a_mute_machine_neither_hears_nor_says_anything(bench):
    bench.machine.fault("mute")
    bench.heard.clear()
    assert bench.command("stand_up").go(1.0).mode is BodyMode.OFF
    assert bench.heard == []


def test_a_fault_that_there_is_not_is_refused(bench):
    with pytest.raises(ValueError, match="there is no fault 'dream'"):
        bench.machine.fault("dream")


def test_a_slow_wire_is_slow_in_both_directions(bench):
    bench.machine.fault("delay", 0.1)
    assert bench.command("stand_up").mode is BodyMode.OFF
    bench.heard.clear()
    bench.go(0.08)
    assert (bench.mode, bench.heard) == (BodyMode.OFF, [])
    assert bench.go(0.06).mode is BodyMode.RISING
    assert bench.heard != []
