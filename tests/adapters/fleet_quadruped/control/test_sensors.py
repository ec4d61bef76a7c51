"""Sensors by frame maps: what counts, for how long, and what is not known any more."""

import math
import struct

import pytest

from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.control.sensors import SensorValues, imu_of
from fleet_quadruped.frames import FieldMap, FrameMap
from fleet_quadruped.robot.parts import Sensor


@pytest.fixture
def values(dog):
    """Return what holds the example dog's battery."""
    return SensorValues(dog.battery)


def turn(*numbers):
    return CanFrame(0x10, struct.pack("<4f", *numbers))


@pytest.fixture
def floats():
    """Return what holds an IMU whose frame has floats."""
    names = ("qw", "qx", "qy", "qz")
    fields = {name: FieldMap(at=4 * place, type="f32") for place, name in enumerate(names)}
    return SensorValues(Sensor(bus="a", frames=(FrameMap(id=0x10, fields=fields),)), whole=True)


def test_a_value_that_becomes_invalid_is_not_known_any_more(values):
    values.handle_frame(CanFrame(0x361, bytes.fromhex("50129E0000")), 1.0)
    assert values.values["percent"] == 80
    values.handle_frame(CanFrame(0x361, bytes.fromhex("FF129E0000")), 2.0)
    assert values.values.keys() == {"voltage", "current"}


def test_an_imu_frame_with_a_value_that_is_no_number_does_not_count(floats):
    floats.handle_frame(turn(1, 0, 0, 0), 1.0)
    floats.handle_frame(turn(0.7, math.nan, 0, 0), 1.5)
    assert floats.values["qw"] == 1.0
    assert floats.age(1.5) == 0.5


def test_a_rotation_that_is_none_is_no_imu(floats):
    floats.handle_frame(turn(0, 0, 0, 0), 1.0)
    assert imu_of(floats.values | dict.fromkeys(("gx", "gy", "gz"), 0.0)) is None


@pytest.mark.parametrize("wild", [3.0e38, -1.0e30, 101.0])
def test_an_imu_frame_that_no_imu_can_mean_does_not_count(wild):
    fields = {name: FieldMap(at=4 * place, type="f32") for place, name in enumerate(("gx", "gy", "gz"))}
    rates = SensorValues(Sensor(bus="a", frames=(FrameMap(id=0x11, fields=fields),)), whole=True)
    rates.handle_frame(CanFrame(0x11, struct.pack("<3f", 0.1, 0.2, 0.3)), 1.0)
    rates.handle_frame(CanFrame(0x11, struct.pack("<3f", 0.1, wild, 0.3)), 2.0)
    assert rates.values["gy"] == pytest.approx(0.2)
    assert rates.age(2.0) == 1.0
