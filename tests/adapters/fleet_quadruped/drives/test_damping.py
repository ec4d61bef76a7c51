"""Drives that damp by themselves: what they should be, what they are, and which of them let go."""

from dataclasses import dataclass

import pytest

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.damping import DampingDrive, DampingGroup
from fleet_quadruped.drives.motor_units import Units


@dataclass(slots=True)
class Drive(DampingDrive):
    """A drive that has torque while it should."""

    def power(self, now):
        return self.obeying, ""


class Group(DampingGroup):
    """Drives that note how they are damped."""

    def __init__(self, *given):
        super().__init__(*given)
        self.damped = []

    def handle_frame(self, bus, frame, now):
        raise NotImplementedError

    def damp(self, kd):
        self.damped.append(kd)

    def want(self, wanted):
        self._want(wanted)

    @property
    def most(self):
        return self._most


@pytest.fixture
def drive(joint_of, wire):
    joint = joint_of(number=7)
    return Drive(joint, wire, 7, Units(joint))


@pytest.fixture
def group(dog, wire, drive):
    return Group(dog, {"a": wire}, [drive])


def noted(drive, *notes):
    """Tell a drive these (obeys, torque off), and return whether it then counts as restarted."""
    for obeys, torque_off in notes:
        drive.note_hold(obeys=obeys, torque_off=torque_off)
    return drive.restarted


OBEYS, OFF, NEITHER = (True, False), (False, True), (False, False)


@pytest.mark.parametrize("wanted", [Power.ENABLED, Power.STOPPING])
def test_a_drive_that_held_and_lets_go_by_itself_has_restarted(drive, wanted):
    drive.wanted = wanted
    assert not noted(drive, OFF, OBEYS, NEITHER)
    assert noted(drive, OFF)
    assert noted(drive, OBEYS), "until it is configured again"


def test_a_drive_that_was_not_enabled_yet_may_be_off(drive):
    drive.wanted = Power.ENABLED
    assert not noted(drive, OFF, NEITHER, OFF)


def test_a_drive_that_was_switched_off_may_be_off_also_when_it_is_wanted_again(drive):
    drive.wanted = Power.ENABLED
    noted(drive, OBEYS)
    drive.wanted = Power.DISABLED
    assert not noted(drive, OBEYS, OFF)
    drive.wanted = Power.ENABLED
    assert not noted(drive, OFF)


@pytest.mark.parametrize(
    ("wanted", "state"),
    [(Power.ENABLED, Power.ENABLED), (Power.STOPPING, Power.STOPPING), (Power.DISABLED, Power.STOPPING)],
)
def test_a_drive_with_torque_counts_as_on_until_it_says_that_it_is_off(drive, wanted, state):
    drive.wanted = wanted
    assert drive.obeying is state


def test_a_drive_that_let_go_says_what_it_said_and_what_helps(drive):
    words = "id 7 switched its torque off (mode 0); it is configured again after a reset"
    assert drive.torque_off_fault("mode 0") == words


def test_everything_that_stops_damps(group, dog):
    group.lower(None, 2.5)
    assert group.probe(1.5)
    group.quick_stop()
    assert group.damped == [2.5, 1.5, dog.safety.kd]
    assert group.braking() == ""


def test_all_drives_want_the_same(group, drive):
    assert drive.wanted is Power.DISABLED
    group.want(Power.ENABLED)
    assert drive.wanted is Power.ENABLED
    assert group.feedback(0.0).all_enabled


def test_a_limit_of_torque_is_kept_until_it_is_lifted(group):
    assert group.most is None
    group.limit_torque(4.0)
    assert group.most == 4.0
    group.limit_torque(None)
    assert group.most is None
