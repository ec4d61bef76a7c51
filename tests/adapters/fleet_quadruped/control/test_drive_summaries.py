"""What the drives say of themselves: which holds, fails or is silent, by the name of its joint."""

import pytest

from fleet_quadruped.control.drive_summaries import (
    all_off,
    failed,
    holding,
    not_enabled,
    silent_bus,
    silent_joint,
)
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback, Power

OFF, ON = JointFeedback(power=Power.DISABLED, age=0.0), JointFeedback(power=Power.ENABLED, age=0.0)


def all_but(other, number, rest=OFF):
    """Return what twelve drives report, one of them something else."""
    return JointsFeedback.of([other if each == number else rest for each in range(12)])


@pytest.mark.parametrize("number", [0, 7, 11])
@pytest.mark.parametrize("power", list(Power))
def test_a_drive_holds_while_it_may_carry_the_robot(dog, power, number):
    holds = power in {Power.ENABLED, Power.STOPPING}
    reported = all_but(OFF._replace(power=power), number)
    assert (
        holding(dog.all_joints, reported)
        == (f"{dog.all_joints[number].name}: the drive is {power.value}") * holds
    )


@pytest.mark.parametrize("power", list(Power))
def test_all_are_off_only_if_each_has_said_so_lately(power):
    off = power in {Power.DISABLED, Power.FAULT}
    assert all_off(all_but(OFF._replace(power=power), 11), 0.1) is off
    assert not all_off(all_but(OFF._replace(age=0.11), 11), 0.1)
    assert all_off(all_but(OFF._replace(age=0.1), 11), 0.1)


def test_a_bus_is_silent_only_if_every_drive_on_it_is(dog):
    assert silent_bus(dog.all_joints, [0.0] * 12, 0.1) == ""
    for bus in {joint.bus for joint in dog.all_joints}:
        ages = [0.2 if joint.bus == bus else 0.0 for joint in dog.all_joints]
        assert silent_bus(dog.all_joints, ages, 0.1) == bus
        ages[[joint.bus for joint in dog.all_joints].index(bus)] = 0.1
        assert silent_bus(dog.all_joints, ages, 0.1) == ""


def test_a_fault_is_named_with_the_words_of_its_drive(dog):
    assert failed(dog.all_joints, all_but(OFF, 0)) == ""
    fault = OFF._replace(power=Power.FAULT)
    assert failed(dog.all_joints, all_but(fault, 5)) == f"{dog.all_joints[5].name}: its drive reports a fault"
    hot = fault._replace(fault="too hot")
    assert failed(dog.all_joints, all_but(hot, 5)) == f"{dog.all_joints[5].name}: too hot"


def test_a_drive_that_is_not_enabled_is_named_with_the_reason(dog):
    assert not_enabled(dog.all_joints, all_but(ON, 0, rest=ON)) == ""
    name = dog.all_joints[11].name
    assert not_enabled(dog.all_joints, all_but(OFF, 11, rest=ON)) == (
        f"{name}: wanted enabled, the drive is disabled"
    )
    assert not_enabled(dog.all_joints, all_but(OFF._replace(fault="no supply"), 11, rest=ON)) == (
        f"{name}: no supply"
    )


def test_a_silent_drive_is_named_with_its_place(dog):
    assert silent_joint(dog.all_joints, [0.1] * 12, 0.1) == ""
    ages = [0.1] * 11 + [0.2]
    joint = dog.all_joints[11]
    assert silent_joint(dog.all_joints, ages, 0.1) == (
        f"{joint.name}: no feedback from id {joint.id} on bus {joint.bus}"
    )
