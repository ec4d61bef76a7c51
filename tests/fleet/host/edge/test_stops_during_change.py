"""Stops that are asked for during a change are set in the robots that it brings."""

from types import SimpleNamespace

import pytest

from fleet.host.edge.stops_during_change import StopsDuringChange
from fleet.host.requests.stop_cause import local_cause
from fleet.host.safety.emergency_stop import EmergencyStopLatch

CAUSE = local_cause("", "test")


@pytest.fixture
def process():
    return SimpleNamespace(stop_requested=None)


def stopped(meanwhile, name):
    latch = EmergencyStopLatch()
    meanwhile.engage(SimpleNamespace(name=name, controller=SimpleNamespace(latch=latch)))
    return bool(latch.cause)


@pytest.mark.parametrize(
    ("names", "reached"), [((), True), (("ada",), True), (("crew",), True), (("rex",), False)]
)
def test_a_stop_during_a_change_reaches_a_robot_by_its_name_its_group_or_none(process, names, reached):
    meanwhile = StopsDuringChange(process)
    meanwhile.begin({"crew": ["ada", "rex"]})
    process.stop_requested(names, CAUSE)
    assert stopped(meanwhile, "ada") is reached


def test_a_stop_before_or_after_a_change_is_not_kept(process):
    meanwhile = StopsDuringChange(process)
    process.stop_requested((), CAUSE)
    meanwhile.begin({})
    assert not stopped(meanwhile, "ada")
    process.stop_requested((), CAUSE)
    meanwhile.end()
    process.stop_requested((), CAUSE)
    assert not stopped(meanwhile, "ada")
