"""The velocity that one robot holds, and what becomes of it when limits or the adapter fail it."""

import pytest

from fleet.errors import LinkLost, Refused
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.velocity_control import VelocityControl
from fleet.model.command import Setpoint
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.robot_config import AdapterConfig, Limits
from fleet.testing.clock import ManualClock

FAST, SLOW = Velocity(Vector3(2.0)), Velocity(Vector3(0.5))
TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


class Adapter:
    """What a velocity is held by; ``raises`` is raised instead."""

    def __init__(self):
        self.config = AdapterConfig(name="rex", twin=TWIN)
        self.driven, self.raises = [], None

    def drive(self, velocity):
        if self.raises is not None:
            raise self.raises
        self.driven.append(velocity)


class Guard:
    """A guard that admits everything; ``unknown`` is raised instead."""

    def __init__(self):
        self.held, self.taken, self.unknown = ZERO_VELOCITY, True, None

    def limited_velocity(self, velocity):
        if self.unknown is not None:
            raise self.unknown
        return velocity


class Control(VelocityControl):
    """The control of one robot, with what it did to it."""

    def __init__(self):
        self.halts, self.crashes, self.adapter, self.guard = 0, [], Adapter(), Guard()
        super().__init__(
            Limits(speed=3.0),
            ManualClock(),
            0.5,
            self.guard,
            combines=True,
            halt=self.count,
            crashed=self.crashes.append,
            barred=lambda: None,
        )

    def count(self):
        self.halts += 1

    def limit(self, speed):
        self.configure(self.adapter.config, Limits(speed=speed))


@pytest.fixture
def control():
    return Control()


@pytest.fixture
def driving(control):
    control.hold(control.adapter, FAST, 0.5)
    return control


def test_a_held_velocity_is_within_lower_limits_at_once(driving):
    driving.limit(0.5)
    assert driving.adapter.driven == [FAST, SLOW]
    assert driving.guard.held == SLOW
    assert driving.activity == "driving"


def test_new_limits_that_change_nothing_are_not_sent_to_the_robot(driving):
    driving.limit(2.5)
    assert driving.adapter.driven == [FAST]


def test_limits_move_no_robot_that_holds_nothing(control):
    control.limit(0.5)
    assert control.adapter.driven == []


@pytest.mark.parametrize("error", [Refused("not today"), LinkLost("no answer")])
def test_a_robot_that_does_not_take_lower_limits_is_halted(driving, error):
    driving.adapter.raises = error
    driving.limit(0.5)
    assert (driving.halts, driving.crashes, driving.activity) == (1, [], "")
    assert driving.guard.held == ZERO_VELOCITY


def test_a_robot_whose_place_is_unknown_under_new_limits_is_halted(driving):
    driving.guard.unknown = Refused("the robot's position is unknown")
    driving.limit(0.5)
    assert (driving.halts, driving.activity) == (1, "")


def test_an_adapter_that_fails_under_new_limits_ends_its_run_as_well(driving):
    driving.adapter.raises = error = ZeroDivisionError("oops")
    driving.limit(0.5)
    assert (driving.halts, driving.crashes) == (1, [error])


def test_a_robot_that_stands_holds_nothing(driving):
    driving.stand(driving.adapter)
    assert driving.adapter.driven[-1] == ZERO_VELOCITY
    assert (driving.halts, driving.activity) == (0, "")


@pytest.mark.parametrize("error", [Refused("not today"), LinkLost("no answer")])
def test_a_robot_that_cannot_even_hold_zero_is_halted(driving, error, caplog):
    driving.adapter.raises = error
    driving.stand(driving.adapter)
    assert (driving.halts, driving.crashes) == (1, [])
    assert str(error) in caplog.text


def test_an_adapter_that_fails_to_stand_ends_its_run_as_well(driving):
    driving.adapter.raises = error = ZeroDivisionError("oops")
    driving.stand(driving.adapter)
    assert (driving.halts, driving.crashes) == (1, [error])


@pytest.mark.parametrize(("error", "halts"), [(Refused("not today"), 0), (LinkLost("no answer"), 1)])
def test_a_first_velocity_whose_link_failed_may_have_been_written_and_is_halted(control, error, halts):
    control.adapter.raises = error
    replies = []
    receipt = Receipt("move", replies.append)
    assert not control.apply(control.adapter, Setpoint(FAST), receipt, superseding=False)
    assert (control.halts, control.activity, [reply.ok for reply in replies]) == (halts, "", [False])
