"""The simulated IMU and battery: their frames, how often they come, and their faults."""

import math

import pytest

from fleet import Quaternion, Vector3, quaternion_from_euler
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.frames import FrameDecoder
from fleet_quadruped.robot.description import load_description
from fleet_quadruped.sim.sensors import Sensors

UP = Vector3(0.0, 0.0, 9.81)


class Bench:
    """The sensors of a dog that is turned as a test says."""

    def __init__(self, dog):
        self.rotation, self.gyro = Quaternion(1.0, 0.0, 0.0, 0.0), Vector3()
        self.sensors = Sensors(dog, self)
        sensors = [sensor for sensor in (dog.imu, dog.battery) if sensor]
        self._decoder = FrameDecoder([frame for sensor in sensors for frame in sensor.frames])

    def imu(self):
        return MeasuredImu(self.rotation, self.gyro, UP)

    def say(self, now=0.0):
        """Return the values of its frames by name."""
        found = {}
        for bus, frame in self.sensors.frames(now):
            assert bus == "a"
            found |= self._decoder.decode(frame.id, frame.data)
        return found


@pytest.fixture
def bench(dog):
    return Bench(dog)


def test_an_imu_says_how_the_body_is_turned_and_how_fast(bench):
    bench.rotation, bench.gyro = quaternion_from_euler(0.2, -0.3, 0.4), Vector3(0.1, -0.2, 0.3)
    said = bench.say()
    turn = [said[name] for name in ("qw", "qx", "qy", "qz")]
    assert turn == pytest.approx(
        [bench.rotation.w, bench.rotation.x, bench.rotation.y, bench.rotation.z], abs=1e-4
    )
    assert [said[name] for name in ("gx", "gy", "gz")] == pytest.approx([0.1, -0.2, 0.3], abs=0.001)
    assert [said[name] for name in ("ax", "ay", "az")] == pytest.approx([0.0, 0.0, 9.81], abs=0.02)


def test_it_comes_with_every_look_and_the_battery_once_a_second(bench):
    assert {"qw", "percent"} <= bench.say(0.0).keys()
    assert "percent" not in bench.say(0.01)
    assert "percent" not in bench.say(0.99)
    assert {"qw", "percent"} <= bench.say(1.0).keys()


def test_an_imu_never_repeats_itself_and_is_the_same_in_every_run(dog):
    one, other = Bench(dog), Bench(dog)
    said = [one.say(now)["az"] for now in range(20)]
    assert len(set(said)) > 2
    assert said == [other.say(now)["az"] for now in range(20)]


def test_a_full_battery_has_48_volts_and_80_percent(bench):
    said = bench.say()
    assert (said["percent"], said["voltage"], said["current"]) == pytest.approx((80.0, 48.0, 3.0))


def test_its_percentage_and_its_voltage_are_set(bench):
    bench.sensors.faults["battery"] = 8.0
    bench.sensors.voltage = 38.5
    said = bench.say()
    assert (said["percent"], said["voltage"]) == pytest.approx((8.0, 38.5))


@pytest.mark.parametrize(("fault", "lacks", "has"), [("imu", "qw", "percent"), ("bms", "percent", "qw")])
def test_a_silent_sensor_says_nothing_and_the_other_one_goes_on(bench, fault, lacks, has):
    bench.sensors.faults[fault] = 1.0
    said = bench.say()
    assert lacks not in said
    assert has in said
    del bench.sensors.faults[fault]
    assert lacks in bench.say()


def test_a_frozen_imu_says_what_it_said_at_first_without_noise(bench):
    bench.say()
    bench.sensors.faults["frozen"] = 1.0
    first = bench.say(2.0)
    bench.rotation, bench.gyro = quaternion_from_euler(0.2, 0.0, 0.0), Vector3(1.0)
    assert bench.say(3.0) == first


def test_an_imu_that_is_mounted_upside_down_says_that_the_dog_is_on_its_back(bench):
    bench.sensors.faults["upside"] = 1.0
    bench.rotation = quaternion_from_euler(0.0, 0.0, 0.6)
    said = bench.say()
    turn = Quaternion(said["qw"], said["qx"], said["qy"], said["qz"])
    assert MeasuredImu(turn, Vector3(), UP).up == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("angles", [(0.3, -0.2, 1.0), (-1.0, 0.5, -2.0), (0.0, 0.0, math.pi / 2)])
def test_an_imu_may_say_roll_pitch_and_yaw(write_dog, angles):
    at = {
        name: f"{{at: {2 * place}, type: i16, scale: 0.0001}}"
        for place, name in enumerate(("roll", "pitch", "yaw"))
    }
    fields = "\n        ".join(f"{name}: {field}" for name, field in at.items())
    quaternion = "\n        ".join(
        f"q{axis}: {{at: {2 * place}, type: i16, scale: 3.0518509475997192e-05}}"
        for place, axis in enumerate("wxyz")
    )
    bench = Bench(load_description(write_dog((quaternion, fields))))
    bench.rotation = quaternion_from_euler(*angles)
    said = bench.say()
    assert (said["roll"], said["pitch"], said["yaw"]) == pytest.approx(angles, abs=1e-3)


def test_a_dog_without_sensors_says_nothing(dog):
    assert Bench(dog.model_copy(update={"imu": None, "battery": None})).say() == {}
