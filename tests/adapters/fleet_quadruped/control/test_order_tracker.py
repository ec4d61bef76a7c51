"""Each activity and each stop of an order is executed once, stops win; a silent host has the robot sit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.order_tracker import OrderTracker
from fleet_quadruped.control.orders import Activity, Order
from fleet_quadruped.safety.stages import EMERGENCY_STOP, REQUESTED_TO_LEAVE, BodyMode, StopStage, Trip

ABANDONED = 2.0
POWERS_UP = {BodyRequest.STAND, BodyRequest.RECOVER, BodyRequest.CHECK, BodyRequest.POSE}


class Body:
    """A body that notes what it is told."""

    def __init__(self):
        self.log, self.fault, self.mode, self.refusal = [], "", BodyMode.STANDING, ""

    def request(self, request, value, _sense):
        self.log.append((request, value))
        return self.refusal

    def halt(self):
        self.log.append("halt")

    def trip(self, trip):
        self.log.append(trip)


class Tracked:
    """A tracker and its body; ``unfit``: why the drives cannot be enabled."""

    def __init__(self):
        self.body, self.unfit = Body(), ""
        self.tracker = OrderTracker(self.body, ABANDONED)

    def execute(self, now=0.0, **order):
        """Execute an order; return what the body was told."""
        before = len(self.body.log)
        self.tracker.execute_order(Order(**order), now, None, lambda: self.unfit)
        return self.body.log[before:]


@pytest.fixture
def it():
    return Tracked()


def an_activity(number, request=BodyRequest.STAND, value=0.0):
    return Activity(number, request, value)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(0, 4)), max_size=12))
def test_each_number_is_executed_once_in_whatever_order_and_however_often_it_comes(orders):
    it = Tracked()
    seen = [0, 0, 0]
    for numbers in orders:
        new = [number > highest for number, highest in zip(numbers, seen, strict=True)]
        seen = [max(pair) for pair in zip(numbers, seen, strict=True)]
        activity, halts, stop = numbers
        done = it.execute(activity=an_activity(activity), halts=halts, stop=stop)
        expected = [(BodyRequest.STAND, 0.0), "halt", Trip(StopStage.DAMP, EMERGENCY_STOP)]
        assert done == [each for each, is_new in zip(expected, new, strict=True) if is_new]
        assert [it.tracker.answered, it.tracker.halted, it.tracker.stopped] == seen


def test_a_value_and_a_refusal_are_passed_on(it):
    it.body.refusal = "too low"
    assert it.execute(activity=an_activity(1, BodyRequest.HEIGHT, 0.2)) == [(BodyRequest.HEIGHT, 0.2)]
    assert it.tracker.refusal == "too low"
    it.body.refusal = ""
    it.execute(activity=an_activity(2))
    assert it.tracker.refusal == ""


@pytest.mark.parametrize("request_", list(BodyRequest))
@pytest.mark.parametrize("mode", [BodyMode.OFF, BodyMode.STANDING])
def test_drives_that_are_unfit_are_not_enabled_and_the_reason_is_told(it, request_, mode):
    it.body.mode, it.unfit = mode, "a battery is empty"
    done = it.execute(activity=an_activity(1, request_))
    refused = request_ in POWERS_UP and mode is BodyMode.OFF
    assert done == ([] if refused else [(request_, 0.0)])
    assert it.tracker.refusal == ("a battery is empty" if refused else "")


def test_a_body_with_a_latched_fault_refuses_by_itself(it):
    it.body.mode, it.body.fault, it.unfit = BodyMode.OFF, "a leg is hot", "a battery is empty"
    it.body.refusal = "it has a fault: a leg is hot"
    it.execute(activity=an_activity(1))
    assert it.tracker.refusal == "it has a fault: a leg is hot"


@pytest.mark.parametrize("request_", list(BodyRequest))
@pytest.mark.parametrize("fault", [EMERGENCY_STOP, "a leg is hot"])
def test_only_getting_up_clears_an_emergency_stop_and_nothing_another_fault(it, request_, fault):
    it.body.fault = fault
    it.execute(activity=an_activity(1, request_))
    clears = fault == EMERGENCY_STOP and request_ in {BodyRequest.STAND, BodyRequest.RECOVER}
    assert it.body.fault == ("" if clears else fault)


def test_an_emergency_stop_latches_a_body_that_is_off_too(it):
    it.body.mode = BodyMode.OFF
    it.execute(stop=1)
    assert it.body.fault == EMERGENCY_STOP
    it.body.fault = "a leg is hot"
    it.execute(stop=2)
    assert it.body.fault == "a leg is hot"


def test_a_stop_in_the_order_that_asks_to_get_up_wins(it):
    it.body.mode, it.body.fault = BodyMode.OFF, EMERGENCY_STOP
    it.execute(activity=an_activity(1), stop=1)
    assert it.body.fault == EMERGENCY_STOP


def test_the_robot_sits_down_when_its_host_is_silent_or_dismisses_it(it):
    assert it.execute(now=10.0 + ABANDONED, alive=10.0) == []
    (trip,) = it.execute(now=10.0 + ABANDONED + 0.6, alive=10.0)
    assert trip == Trip(StopStage.SIT, "no contact with its host for 3 s")
    assert it.execute(now=10.0, alive=10.0, leave=True) == [Trip(StopStage.SIT, REQUESTED_TO_LEAVE)]
