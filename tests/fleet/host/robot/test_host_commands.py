"""What the host does for a robot by itself: release its stop, restart its adapter, set the speed of verbs."""

import pytest

from fleet.model.command import ReplyStatus
from fleet.model.navigation import Control, Navigate

ACCEPTED = ReplyStatus.ACCEPTED


async def test_the_release_needs_an_accepted_source(bench, requests):
    bench.controller.emergency("test")
    bench.request(requests.command("release_emergency_stop", source="sim"))
    assert bench.controller.latched


async def test_a_release_that_is_delivered_again_does_not_release_the_next_stop(bench, requests):
    bench.controller.emergency("one")
    bench.request(requests.command("release_emergency_stop", id="r1"))
    bench.controller.emergency("two")
    bench.request(requests.command("release_emergency_stop", id="r1"))
    assert bench.controller.latched


async def test_the_adapter_is_restarted_by_who_may_command_it(bench, requests):
    bench.request(requests.command("restart_adapter", source="sim"))
    assert bench.restarts == []
    bench.request(requests.command("restart_adapter"))
    assert bench.restarts == [1]


def a_setting(requests, value=0.2, session="anna"):
    """Return the message that sets how fast later verbs are."""
    return requests.command("set_linear_velocity", session=session, data={"linear": value})


async def test_a_velocity_that_is_set_moves_nothing_and_its_answer_has_the_applied_value(bench, requests):
    answers = bench.request(a_setting(requests, 99.0), waits=True)
    await requests.settle()
    assert bench.adapter.calls == []
    assert not bench.controller.in_motion
    assert [(answer.status, answer.data) for answer in answers] == [(ACCEPTED, {"linear": 2.0})]
    assert bench.controller.speeds.of("anna").forward == 2.0


@pytest.mark.parametrize(
    "end",
    [
        lambda bench, requests: bench.request(requests.command("stop", session="bert")),
        lambda bench, requests: bench.request(requests.command("emergency_stop")),
        lambda bench, requests: bench.request(Navigate(Control.STOP, "", requests.goal().origin)),
        lambda bench, requests: bench.controller.authority_lost("the pilot switched to POSHOLD"),
        lambda bench, requests: bench.controller.detach("it begins anew"),
        lambda bench, requests: bench.clock.advance(10.0) or bench.request(requests.setpoint(session="bert")),
    ],
    ids=["stop", "emergency stop", "stop of navigation", "takeover", "restart", "another driver"],
)
async def test_a_velocity_that_is_set_ends_with(bench, requests, end):
    bench.request(a_setting(requests))
    assert bench.controller.speeds.of("anna").forward == 0.2
    end(bench, requests)
    await requests.settle()
    assert bench.controller.speeds.of("anna").forward == 0.5


async def test_a_velocity_cannot_be_set_by_who_may_not_move_the_robot(bench, requests):
    bench.request(requests.setpoint())
    assert "has control" in bench.request(a_setting(requests, session="bert"))[0].reason
    bench.request(requests.command("emergency_stop"))
    await requests.settle()
    assert "emergency stop is set" in bench.request(a_setting(requests))[0].reason
    assert bench.controller.speeds.of("anna").forward == 0.5
