"""That the torque is off is believed once every drive has said so; after a second its lack is a fault."""

import pytest

from fleet_quadruped.control.torque_off_monitor import TorqueOffMonitor
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback, Power

STALE = 0.1


def said(*powers, age=0.0):
    """Return what twelve drives report, the last ones off."""
    powers += (Power.DISABLED,) * (12 - len(powers))
    return JointsFeedback.of([JointFeedback(power=power, age=age) for power in powers])


@pytest.fixture
def watch(dog):
    return TorqueOffMonitor(dog.all_joints, STALE)


def wait(watch, reported, seconds, *, off=True):
    for _ in range(round(seconds / 0.01)):
        watch.update(reported, 0.01, off=off)


@pytest.mark.parametrize("powers", [(), (Power.FAULT,)])
def test_it_is_over_as_soon_as_every_drive_is_off(watch, powers):
    assert not watch.over
    watch.update(said(*powers), 0.01, off=True)
    assert watch.over
    assert watch.torque_on_fault(said()) == ""


@pytest.mark.parametrize("power", [Power.ENABLED, Power.STOPPING])
def test_a_drive_that_holds_on_is_named_once_the_time_is_over(watch, power):
    reported = said(Power.DISABLED, power)
    wait(watch, reported, 0.95)
    assert not watch.over
    assert watch.torque_on_fault(reported) == ""
    wait(watch, reported, 0.1)
    assert watch.over
    fault = watch.torque_on_fault(reported)
    assert fault == f"{watch._joints[1].name}: the drive is {power.value}, wanted off"


@pytest.mark.parametrize("reported", [said(age=STALE + 0.01), said(Power.ABSENT), said(Power.STARTING)])
def test_what_is_old_or_not_known_to_be_off_confirms_nothing(watch, reported):
    wait(watch, reported, 0.9)
    assert not watch.over
    wait(watch, reported, 0.2)
    assert watch.over
    assert watch.torque_on_fault(reported) == "", "none of them is known to have torque"


def test_the_time_counts_only_while_the_drives_should_be_off(watch):
    reported = said(Power.ENABLED)
    wait(watch, reported, 0.9)
    wait(watch, reported, 5.0, off=False)
    assert not watch.over
    wait(watch, reported, 0.9)
    assert not watch.over


def test_a_drive_that_gets_torque_again_is_no_longer_confirmed(watch):
    wait(watch, said(), 2.0)
    reported = said(Power.ENABLED)
    watch.update(reported, 0.01, off=True)
    assert "wanted off" in watch.torque_on_fault(reported)
