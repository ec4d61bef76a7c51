"""What a request would meet now: the same rules as the request itself, and nothing happens."""

import pytest

from fleet.commands import commands_of
from fleet.host.robot.dry_run import against, would_refuse
from fleet.model.command import Command, Origin, Transport
from fleet.model.navigation import Control, Navigate
from tests.fleet.host.conftest import FakeAdapter

SPECS = commands_of(FakeAdapter)
EVERY = (*SPECS, "stop", "emergency_stop")


TAKEOFF = Command("takeoff", origin=Origin(Transport.BUS))


def refusals(bench):
    """Return why each command would be refused now, those that would be accepted left out."""
    found = {name: would_refuse(bench.controller, name, SPECS.get(name)) for name in EVERY}
    return {name: why for name, why in found.items() if why}


async def test_nothing_is_refused_at_rest_and_nothing_happens(bench):
    assert refusals(bench) == {}
    assert (bench.adapter.calls, bench.controller.activity) == ([], "")
    assert not bench.controller.motion.in_control


async def test_with_an_emergency_stop_only_what_is_safe_would_be_accepted(bench, requests):
    bench.controller.emergency("test")
    await requests.settle()
    found = refusals(bench)
    assert set(found) == {"takeoff", "arm", "shy"}
    assert all(why.startswith("emergency stop is set") for why in found.values())


async def test_a_busy_robot_would_refuse_what_does_not_interrupt(bench, requests):
    bench.request(TAKEOFF)
    await requests.settle()
    assert refusals(bench)["arm"] == "busy with takeoff"
    assert {"stop", "emergency_stop", "land", "battery_check"}.isdisjoint(refusals(bench))


async def test_a_robot_that_is_offline_would_refuse_all_but_the_host_s_own_stops(bench):
    bench.controller.attached.offline = "its cable is out"
    found = refusals(bench)
    assert set(found) == set(SPECS)
    assert all("its cable is out" in why for why in found.values())


@pytest.mark.parametrize("name", EVERY)
async def test_what_would_be_accepted_is_accepted(bench, requests, name):
    """The dry run and the request must not come apart."""
    accepted = not would_refuse(bench.controller, name, SPECS.get(name))
    answers = bench.request(Command(name, origin=Origin(Transport.BUS)))
    await requests.settle()
    assert accepted
    assert answers == [] or answers[0].ok or answers[0].reason == "not today"


def starts(bench, request, name=""):
    return against(bench.controller, request, SPECS.get(name))


async def test_a_robot_at_rest_would_start_a_command_or_a_goal_together_with_others(bench, requests):
    assert starts(bench, requests.command("takeoff"), "takeoff") == ""
    bench.report_pose()
    assert starts(bench, requests.goal()) == ""
    assert bench.adapter.calls == []


async def test_why_a_robot_would_not_start_together_with_others(bench, requests):
    takeoff = requests.command("takeoff")
    assert starts(bench, requests.command("dance"), "dance") == (
        "rex has no 'dance' that could be started together"
    )
    wrong = requests.command("takeoff", data={"altitude": "high"})
    assert "altitude" in starts(bench, wrong, "takeoff")
    assert starts(bench, Navigate(Control.PAUSE)) == "navigate is not started together"
    bench.controller.emergency("test")
    await requests.settle()
    for name in ("takeoff", "land"):
        assert starts(bench, requests.command(name), name).startswith("emergency stop is set")
    bench.controller.attached.offline = "its cable is out"
    assert starts(bench, takeoff, "takeoff") == "rex is offline: its cable is out"


async def test_a_busy_robot_would_not_start_together_even_what_interrupts(bench, requests):
    bench.request(requests.command("takeoff"))
    await requests.settle()
    for name in ("land", "takeoff"):
        assert starts(bench, requests.command(name), name) == "busy with takeoff"
