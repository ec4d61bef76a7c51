"""What happens to a robot is told with the command that led to it and who asked for that."""

import logging

import pytest

from fleet.host.requests.event_reporter import EventReporter
from fleet.model.command import Transport
from fleet.model.event import EventReport, Requester
from fleet.model.report import TelemetryReport
from fleet.robot_config import FenceConfig

FENCE = FenceConfig(frame="world", inclusion=[[(-10, -10), (10, -10), (10, 10), (-10, 10)]])
ANNA = Requester(Transport.CLOUD, "anna", "tele")


def events(bench):
    """Return the events that were told, without what is asked and how it ends."""
    reported = [report for report in bench.reports if isinstance(report, EventReport)]
    return [event for event in reported if event.kind not in {"command", "outcome", "stop", "release"}]


async def test_motion_ends_though_it_cannot_be_reported(bench, requests, caplog):
    def fail(*_):
        raise ZeroDivisionError("oops")

    bench.request(requests.goal())
    await requests.settle()
    reporter = EventReporter("rex", fail, bench.clock, in_motion=lambda: True)
    reporter.heard = fail
    bench.controller.event_reporter = bench.controller.motion._event_reporter = reporter
    bench.controller.authority_lost("the pilot switched to POSHOLD")
    assert bench.statuses()[-1] == "failed"
    assert not bench.controller.motion.in_control
    assert "an event of rex could not be reported" in caplog.text


async def test_a_breach_under_way_names_the_goal_that_led_to_it(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    assert bench.request(requests.goal("a7"))[0].ok
    bench.report_pose(14.0)
    (breach,) = events(bench)
    assert (breach.kind, breach.asker, breach.request) == ("fence_breached", ANNA, "a7")
    assert breach.data == {"reason": breach.text.removeprefix("it is ")}


async def test_a_robot_that_is_blown_out_of_its_fence_moves_for_nobody(make_bench):
    bench = make_bench(fence=FENCE)
    bench.report_pose(14.0)
    (breach,) = events(bench)
    assert (breach.asker, breach.request, breach.command) == (None, "", "")


async def test_an_emergency_stop_is_an_event_once_until_it_was_released(bench, requests):
    for name in ("emergency_stop", "emergency_stop", "release_emergency_stop", "emergency_stop"):
        bench.request(requests.command(name, id="q1"))
    assert [(event.kind, event.severity, event.asker) for event in events(bench)] == [
        ("emergency_stop", "critical", ANNA)
    ] * 2
    assert events(bench)[0].request == "q1"


async def test_a_pilot_who_takes_the_robot_is_an_event_that_names_what_he_ended(bench, requests):
    bench.request(requests.command("takeoff", id="q2"))
    await requests.settle()
    bench.controller.authority_lost("the pilot took it")
    (taken,) = events(bench)
    assert (taken.kind, taken.command, taken.request) == ("authority_lost", "takeoff", "q2")
    assert [report.type for report in bench.reports if isinstance(report, TelemetryReport)] == [
        "authority_lost"
    ]


async def test_a_low_battery_and_what_is_done_about_it_are_events(make_bench, requests):
    bench = make_bench(battery_policy={"low": 15, "reserve": 20, "action": "land"})
    bench.request(requests.setpoint(1.0))
    bench.report_battery(10.0)
    await requests.settle()
    low, done = events(bench)
    assert (low.text, low.data) == ("its battery is low: 10 %", {"percent": 10.0, "action": "land"})
    assert (done.kind, done.text) == ("battery", "land by battery_policy: the battery was at 10 %")


def end_of_a_stream(bench, requests):
    """Let the lease of a velocity run out that had renewed another."""
    bench.report_pose(0.0)
    for _ in range(2):
        bench.request(requests.setpoint())
        bench.clock.advance(0.1)
    bench.controller.motion.lease_ran_out()


@pytest.mark.parametrize(
    "what",
    [
        end_of_a_stream,
        lambda bench, _requests: bench.controller.authority_lost("the pilot took it"),
        lambda bench, requests: bench.request(requests.command("release_emergency_stop")),
        lambda bench, _requests: bench.report_pose(14.0),
    ],
)
async def test_what_the_host_warns_of_a_robot_is_in_the_robots_own_log(make_bench, requests, caplog, what):
    caplog.set_level(logging.WARNING)
    what(make_bench(fence=FENCE), requests)
    assert {record.name for record in caplog.records} == {"fleet.robot.rex"}
