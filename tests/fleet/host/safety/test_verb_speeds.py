"""How fast a verb is that does not say."""

import pytest

from fleet.host.safety.verb_speeds import VERB_SPEED, VerbSpeeds
from fleet.model.command import Command, Origin, Transport
from fleet.robot_config import Limits
from fleet.wire.commands import MotionDefaults

LIMITS = Limits(speed=0.8, vertical_speed=0.3, yaw_rate=1.0)
USUAL = MotionDefaults(forward=0.5, lateral=0.5, vertical=0.3, yaw_rate=0.5)


def linear(value, session="anna"):
    return Command("set_linear_velocity", {"linear": value}, Origin(Transport.CLOUD, "tele", session))


def angular(value, session="anna"):
    return Command("set_angular_velocity", {"angular": value}, Origin(Transport.CLOUD, "tele", session))


@pytest.fixture
def speeds():
    return VerbSpeeds(LIMITS)


def test_nothing_is_set_at_the_beginning(speeds):
    assert speeds.of("anna") == USUAL
    assert VerbSpeeds(Limits()).of("").forward == VERB_SPEED


@pytest.mark.parametrize(
    ("requested", "applied"), [(0.2, 0.2), (0.8, 0.8), (99.0, 0.8), (-0.3, 0.3), (0.0, 0.0)]
)
def test_what_is_set_is_applied_within_the_limits_and_echoed(speeds, requested, applied):
    assert speeds.store(linear(requested)) == {"linear": applied}
    found = speeds.of("anna")
    assert (found.forward, found.lateral, found.vertical) == (applied, applied, min(applied, 0.3))
    assert found.yaw_rate == 0.5


def test_both_settings_stand_side_by_side(speeds):
    speeds.store(linear(0.2))
    assert speeds.store(angular(3.0)) == {"angular": 1.0}
    assert speeds.of("anna") == MotionDefaults(0.2, 0.2, 0.2, 1.0)


def test_a_setting_is_for_who_set_it_and_ends_when_somebody_else_drives(speeds):
    speeds.store(linear(0.2))
    assert speeds.of("bert") == USUAL
    speeds.driven_by("anna")
    assert speeds.of("anna").forward == 0.2
    speeds.driven_by("bert")
    assert speeds.of("anna") == USUAL


def test_who_sets_after_another_begins_from_nothing(speeds):
    speeds.store(linear(0.2))
    speeds.store(angular(0.1, "bert"))
    assert speeds.of("bert") == MotionDefaults(0.5, 0.5, 0.3, 0.1)
    assert speeds.of("anna") == USUAL


def test_a_setting_that_is_forgotten_is_gone(speeds):
    speeds.store(linear(0.2))
    speeds.forget()
    assert speeds.of("anna") == USUAL


def test_new_limits_make_every_verb_slower_and_forget_what_was_set(speeds):
    speeds.configure(None, Limits(speed=0.1, vertical_speed=0.1, yaw_rate=0.1))
    assert speeds.of("anna") == MotionDefaults(forward=0.1, lateral=0.1, vertical=0.1, yaw_rate=0.1)
