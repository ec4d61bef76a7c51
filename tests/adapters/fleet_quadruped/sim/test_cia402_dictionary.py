"""The objects of a simulated drive: as it is delivered, as it is written to, and in other models."""

import math

import pytest

from fleet_quadruped.drives.cia402.setup import ERROR_BEHAVIOUR as ERROR_ENTRY
from fleet_quadruped.drives.cia402.setup import TORQUE, TORQUE_OFFSET, mapping_objects
from fleet_quadruped.sim.brakes import STIFF
from fleet_quadruped.sim.cia402_dictionary import ERROR_BEHAVIOUR, Cia402Dictionary, DriveConfiguration


@pytest.fixture
def objects(dog):
    return Cia402Dictionary(dog.all_joints[4], dog.drive, lambda frame: None)


def write(objects, values):
    for place, value in values.items():
        objects.objects[place].value = value
    return objects.configuration()


def test_as_it_is_delivered_nothing_watches_over_its_master(objects):
    assert objects.configuration() == DriveConfiguration(math.inf, math.inf, math.inf, 0.001)
    assert objects.objects[ERROR_BEHAVIOUR].value == 0  # pre-operational after an error of the bus
    assert objects.objects[0x605A, 0].value == 2  # it brakes, and lets go
    assert objects.objects[0x6007, 0].value == 0  # it goes on


def test_times_are_written_in_milliseconds(objects):
    found = write(objects, {(0x1016, 1): 0x7F_0064, (0x1017, 0): 50})
    assert (found.timeout, found.beat) == (0.1, 0.05)


@pytest.mark.parametrize(
    ("number", "exponent", "cycle"), [(10, 0xFD, 0.01), (25, 0xFC, 0.0025), (1, 0, 1.0), (2, 1, 20.0)]
)
def test_the_period_of_interpolation_has_a_power_of_ten(objects, number, exponent, cycle):
    assert write(objects, {(0x60C2, 1): number, (0x60C2, 2): exponent}).cycle == pytest.approx(cycle)


@pytest.mark.parametrize(("per_mille", "torque"), [(1000, 8.0), (300, 2.4), (0, 0.0)])
def test_a_torque_limit_is_per_mille_of_rated_torque_and_bounds_the_error_of_position(
    objects, per_mille, torque
):
    assert write(objects, {(0x6072, 0): per_mille}).reach == pytest.approx(torque / STIFF)


def test_the_mode_that_is_shown_is_the_one_that_is_written(objects):
    objects.objects[0x6060, 0].value = 8
    assert objects.objects[0x6061, 0].value == 8
    objects.keep_mode()
    objects.objects[0x6060, 0].value = 8
    assert objects.objects[0x6061, 0].value == 1


def test_it_is_a_servo_drive_with_cyclic_positions(objects):
    assert objects.objects[0x1000, 0].value & 0xFFFF == 402
    assert objects.objects[0x6502, 0].value >> 7 & 1
    objects.pretend()
    assert objects.objects[0x1000, 0].value & 0xFFFF == 401


def test_each_object_that_is_mapped_to_it_is_there_with_its_size(dog, objects):
    for item in mapping_objects(dog.drive, 5):
        assert objects.objects[item.place, item.sub].size == item.size


def test_a_plain_model_has_no_torques_and_cannot_map_them(objects):
    objects.be_plain()
    assert (0x60B2, 0) not in objects.objects
    assert (0x6077, 0) not in objects.objects
    assert {TORQUE, TORQUE_OFFSET} <= objects.unmappable
    assert objects.configuration() == DriveConfiguration(cycle=0.001)


def test_a_simple_model_has_no_error_behaviour(objects):
    objects.be_simple()
    assert (ERROR_ENTRY >> 16, ERROR_ENTRY >> 8 & 0xFF) == ERROR_BEHAVIOUR
    assert ERROR_BEHAVIOUR not in objects.objects


def test_a_drive_that_refuses_does_not_map_its_control_word(objects):
    objects.refuse()
    assert objects.refusals == {(0x1600, 1): 0x06040041}  # cannot be mapped
