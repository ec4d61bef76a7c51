import click.testing
import pytest

from fleet.errors import ConfigError, LinkRefused
from fleet.testing.clock import ManualClock
from fleet_quadruped.bench_tools import BenchSession, offsets, problems, scan
from fleet_quadruped.cli import can
from fleet_quadruped.drives.base import Power
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim.lockstep import lockstep


class Ticking(ManualClock):
    """A clock that goes on by ``step`` seconds whenever it is read."""

    def __init__(self, step=0.005):
        super().__init__()
        self._step = step

    def monotonic(self):
        self.advance(self._step)
        return super().monotonic()


@pytest.fixture
def on_bench(any_dog):
    sim, buses = lockstep(any_dog)
    return sim, buses, BenchSession(any_dog, buses, Ticking())


def run(*arguments):
    return click.testing.CliRunner().invoke(can, [str(text) for text in arguments], standalone_mode=False)


def test_a_good_description_is_reported_with_its_load():
    result = run("check", EXAMPLE)
    assert result.return_value == 0
    assert "bus a: 40% of 1000000 bit/s at 100 cycles a second" in result.output


def test_a_bad_description_is_reported(write_dog):
    result = run("check", write_dog(("mass: 12.6", "mass: -1")))
    assert isinstance(result.exception, ConfigError)


@pytest.mark.parametrize("command", ["check", "monitor"])
def test_buses_that_the_description_does_not_have_are_refused(command):
    result = run(command, EXAMPLE, "--bus", "b=can:virtual:x")
    assert isinstance(result.exception, LinkRefused)


def test_calibrating_asks_first():
    result = click.testing.CliRunner().invoke(can, ["calibrate", str(EXAMPLE)], input="n\n")
    assert result.exit_code == 1
    assert "Is the dog in the pose" in result.output


@pytest.mark.parametrize("any_dog", ["cia402", "mit"], indirect=True)  # those that a scan can ask safely
def test_all_twelve_devices_are_found(any_dog):
    _, buses = lockstep(any_dog)
    found = scan(buses["a"], Ticking(0.3))
    assert len(found) == 12
    assert "drive (CiA 402)" in found[0] or "MIT motor" in found[0]


def test_an_empty_bus_has_no_devices(dog):
    sim, buses = lockstep(dog)
    for number in range(12):
        sim.fault("mute", number + 1)
    buses["a"].receive(0.0)
    assert scan(buses["a"], Ticking(0.3)) == []


def test_a_dog_on_the_bench_is_never_enabled(on_bench):
    sim, _, bench = on_bench
    feedback = bench.settle()
    assert {joint.power for joint in feedback} == {Power.DISABLED}
    assert all(motor.kp == motor.kd == 0 for motor in sim.world.motors)
    assert problems(bench.joints, feedback) == []


def test_a_silent_drive_is_named(on_bench):
    sim, _, bench = on_bench
    sim.fault("mute", 9)
    assert problems(bench.joints, bench.settle(200)) == ["RL_knee: id 9 on bus 'a' is silent"]


def test_the_offsets_of_a_dog_in_a_known_pose_are_measured(on_bench):
    _, _, bench = on_bench
    pose = bench.dog.posture(bench.dog.poses.fold)
    found = offsets(bench.dog, bench.settle(), pose)
    assert found == pytest.approx({joint.name: joint.offset for joint in bench.dog.all_joints}, abs=2e-3)
