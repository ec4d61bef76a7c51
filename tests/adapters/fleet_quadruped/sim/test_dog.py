"""A simulated dog: drives, sensors and wires on one bus, and each fault at its place."""

import pytest

from fleet import CanFrame
from fleet_quadruped.drives.cia402.frames import SYNC, TPDO1
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.sim.dog import SimDog
from fleet_quadruped.sim.faults import DOG_FAULTS
from fleet_quadruped.sim.world import KinematicWorld

RL_HIP = 8  # number of the joint, and id of its drive
OF_A_JOINT = sorted(name for name, what in DOG_FAULTS.items() if what.startswith("joint"))


class Bench:
    def __init__(self, dog):
        self.heard = []
        self.sim = SimDog(dog, KinematicWorld(dog), {"a": self.heard.append})
        for number in range(1, 13):
            self.sim.handle_frame("a", CanFrame(0x000, bytes([1, number])))

    def answers(self):
        """Return the ids of the drives that answer a SYNC now."""
        self.heard.clear()
        self.sim.handle_frame("a", CanFrame(SYNC, b""))
        return [frame.id - TPDO1 for frame in self.heard]

    def sensors(self, dt=0.01, **how):
        """Return the identifiers of what is sent in a while."""
        self.heard.clear()
        self.sim.advance(dt, **how)
        return {frame.id for frame in self.heard}

    @property
    def drive(self):
        return self.sim.drives[RL_HIP - 1]

    @property
    def motor(self):
        return self.sim.world.motors[RL_HIP - 1]


@pytest.fixture
def bench(dog):
    return Bench(dog)


def test_each_drive_answers_on_its_bus(bench):
    assert bench.answers() == list(range(1, 13))


def test_its_sensors_are_sent_when_they_are_asked_for(bench):
    assert bench.sensors(sense=False) == set()
    assert bench.sensors() == {0x110, 0x111, 0x112, 0x361}
    assert bench.sensors() == {0x110, 0x111, 0x112}


@pytest.mark.parametrize(("dt", "steps"), [(0.002, 1), (0.01, 1), (0.02, 2), (0.1, 10)])
def test_time_passes_in_steps_of_about_ten_milliseconds(bench, monkeypatch, dt, steps):
    passed = []
    monkeypatch.setattr(bench.sim.world, "step", passed.append)
    bench.sim.advance(dt)
    assert passed == pytest.approx([dt / steps] * steps)
    assert bench.sim.time == dt


@pytest.mark.parametrize("fault", OF_A_JOINT)
@pytest.mark.parametrize("number", [0.0, 13.0, 0.5])
def test_a_joint_that_it_does_not_have_has_no_fault(bench, fault, number):
    with pytest.raises(ValueError, match=f"fault {fault}: "):
        bench.sim.fault(fault, number)


def test_a_fault_that_there_is_not_is_refused(bench):
    with pytest.raises(ValueError, match="there is no fault 'dream'"):
        bench.sim.fault("dream")


def test_a_mute_drive_is_missed_and_no_other(bench):
    bench.sim.fault("mute", RL_HIP)
    assert bench.answers() == [number for number in range(1, 13) if number != RL_HIP]


def test_a_second_drive_at_an_id_answers_too_and_says_something_else(bench):
    bench.sim.fault("twin", RL_HIP)
    bench.sim.handle_frame("a", CanFrame(0x000, bytes([1, RL_HIP])))
    assert bench.answers().count(RL_HIP) == 2
    both = [frame.data for frame in bench.heard if frame.id == TPDO1 + RL_HIP]
    assert both[0] != both[1]


def test_a_weak_motor_has_no_torque_whatever_its_drive_wants(bench, monkeypatch):
    def control(dt):
        bench.motor.kp, bench.motor.kd, bench.motor.feed = 100.0, 3.0, 5.0

    monkeypatch.setattr(bench.drive, "control", control)
    bench.sim.advance(0.01)
    assert bench.motor.kp == 100.0
    bench.sim.fault("weak", RL_HIP)
    bench.sim.advance(0.01)
    assert (bench.motor.kp, bench.motor.kd, bench.motor.feed) == (0.0, 0.0, 0.0)


def test_faults_of_a_drive_are_those_of_its_joint(bench):
    bench.sim.fault("overcurrent", RL_HIP)
    assert [drive.state is DriveState.FAULT for drive in bench.sim.drives] == [
        number == RL_HIP for number in range(1, 13)
    ]
    bench.sim.fault("jump", RL_HIP)
    assert bench.drive.encoder.off == 0.5


@pytest.mark.parametrize("fault", ["deaf", "stays", "mode"])
def test_a_fault_of_cia_402_is_refused_for_other_drives(dogs, fault):
    with pytest.raises(ValueError, match=f"fault {fault} is one of CiA 402 drives"):
        Bench(dogs["moteus"]).sim.fault(fault, RL_HIP)


def test_the_voltage_is_that_of_all_drives_and_of_the_battery(bench):
    bench.sim.fault("volts", 38.5)
    assert {drive.voltage for drive in bench.sim.drives} == {38.5}
    assert bench.sim._sensors.voltage == 38.5


def test_a_fault_of_a_sensor_or_a_wire_is_cleared(bench):
    bench.sim.fault("imu")
    bench.sim.fault("silent")
    assert (bench.answers(), bench.sensors()) == ([], set())
    bench.sim.clear("silent")
    assert (len(bench.answers()), bench.sensors(1.0)) == (12, {0x361})
    bench.sim.clear("imu")
    assert bench.sensors() == {0x110, 0x111, 0x112}


def test_on_a_slow_wire_frames_are_late_in_both_directions(bench):
    bench.sim.fault("delay", 0.05)
    assert bench.answers() == []
    for _ in range(6):
        bench.sim.advance(0.01, sense=False)
    assert bench.heard == []  # the SYNC has arrived by now, and the answers are on their way
    for _ in range(5):
        bench.sim.advance(0.01, sense=False)
    assert [frame.id - TPDO1 for frame in bench.heard] == list(range(1, 13))


def test_a_frame_reaches_the_drives_of_its_bus_alone(dog):
    tree = dog.model_dump(by_alias=True)
    tree["buses"]["b"] = {"bitrate": 1_000_000}
    tree["joints"]["FL_abad"]["bus"] = "b"
    two = type(dog).model_validate(tree)
    heard = {"a": [], "b": []}
    sim = SimDog(two, KinematicWorld(two), {bus: frames.append for bus, frames in heard.items()})
    for bus, number in (("a", 0), ("b", 0)):
        sim.handle_frame(bus, CanFrame(0x000, bytes([1, number])))
        heard[bus].clear()
    sim.handle_frame("b", CanFrame(SYNC, b""))
    assert ([frame.id for frame in heard["b"]], heard["a"]) == ([TPDO1 + 1], [])
    sim.handle_frame("a", CanFrame(SYNC, b""))
    assert (len(heard["a"]), len(heard["b"])) == (11, 1)
