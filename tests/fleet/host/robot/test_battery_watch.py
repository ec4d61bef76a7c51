"""A robot whose battery is watched: what it may begin, and what is done when it is low."""

import pytest

from fleet.errors import NotReady
from fleet.model.event import EventReport
from fleet.model.geometry import Vector3
from fleet.model.navigation import Goal, GoTo, Navigate
from fleet.robot_config import BatteryPolicy

POLICY = {"reserve": 20, "low": 15, "endurance": 100}


def goal(requests, task):
    """Return the navigation message of a task."""
    return Navigate(task, "", requests.goal().origin)


async def test_a_goal_beyond_the_battery_is_refused(make_bench, requests):
    bench = make_bench(battery_policy=POLICY)
    bench.report_pose()
    bench.report_battery(60.0)
    far, near = GoTo(Goal(Vector3(60, 0, 0))), GoTo(Goal(Vector3(30, 0, 0)))
    assert (
        "the way there and home takes 60 %" in bench.request(goal(requests, far))[0].reason
    )  # 120 m at 2 m/s
    assert bench.request(goal(requests, near))[0].ok


@pytest.mark.parametrize("before", [(), (14.0,)])
async def test_a_low_battery_is_acted_upon_once_while_we_move_the_robot_also_when_it_was_low_before(
    make_bench, requests, before
):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    for percent in before:
        bench.report_battery(percent)
    bench.request(requests.setpoint(1.0))
    for percent in (16.0, 15.0, 14.0, 10.0, 5.0):
        bench.report_battery(percent)
        await requests.settle()
    assert bench.adapter.calls.count("land") == 1
    assert len(bench.telemetry_of("battery_low")) == 1


async def test_a_take_off_that_the_low_battery_would_end_at_once_is_refused(make_bench, requests):
    bench = make_bench(battery_policy={"action": "return_to_home"})
    bench.report_battery(20.0)
    answer = bench.request(requests.command("takeoff"))[0]
    assert answer.reason == "the battery is at 20 %, a take-off needs more than 20 %"
    bench.report_battery(21.0)
    bench.request(requests.command("takeoff"))
    await requests.settle()
    assert ("takeoff", None) in bench.adapter.calls


def test_the_policy_of_a_robot_that_says_none_of_it_leaves_room_for_the_way_home():
    policy = BatteryPolicy()
    assert (policy.reserve, policy.low) == (15.0, 20.0)


async def test_a_forced_action_is_reported_with_its_cause_until_the_battery_was_charged(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.request(requests.setpoint(1.0))
    assert bench.controller.guard.cause == ""
    bench.report_battery(15.0)
    await requests.settle()
    bench.report_battery(12.0)
    assert bench.controller.guard.cause == "land by battery_policy: the battery was at 15 %"
    bench.report_battery(90.0)
    assert bench.controller.guard.cause == ""


async def test_a_forced_action_that_failed_says_why(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "return_to_home"})  # which the puppet has not
    bench.request(requests.setpoint(1.0))
    bench.report_battery(15.0)
    await requests.settle()
    assert (
        bench.controller.guard.cause == "return_to_home by battery_policy failed: rex has no 'return_to_home'"
    )


async def test_an_action_that_is_refused_again_and_again_is_reported_once(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "return_to_home"})  # which the puppet has not
    bench.request(requests.setpoint(1.0))
    for percent in (15.0, 14.0, 13.0):
        bench.report_battery(percent)
        await requests.settle()
    texts = [each.text for each in bench.reports if isinstance(each, EventReport)]
    assert sum("battery_policy failed" in text for text in texts) == 1


async def test_a_low_battery_of_a_robot_that_is_not_ours_is_only_reported(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.report_battery(10.0)
    await requests.settle()
    assert bench.adapter.calls == []
    assert bench.telemetry_of("battery_low")


async def test_a_low_battery_ends_no_emergency_stop_and_is_acted_upon_after_its_release(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.request(requests.setpoint(1.0))
    bench.request(requests.command("emergency_stop"))
    await requests.settle()
    bench.report_battery(14.0)
    await requests.settle()
    assert bench.telemetry_of("battery_low")
    assert "land" not in bench.adapter.calls
    bench.request(requests.command("release_emergency_stop"))
    bench.report_battery(14.0)
    await requests.settle()
    assert bench.adapter.calls.count("land") == 1


async def test_a_low_battery_is_acted_upon_again_only_after_it_was_charged(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    lands = []
    for percent in (15.0, 15.1, 15.0, 17.0, 14.0, 90.0, 15.0):
        bench.request(requests.setpoint(1.0))
        bench.report_battery(percent)
        await requests.settle()
        lands.append(bench.adapter.calls.count("land"))
    assert lands == [1, 1, 1, 1, 1, 1, 2]
    assert len(bench.telemetry_of("battery_low")) == 2


async def test_an_action_that_could_not_be_asked_is_asked_with_the_next_look(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.request(requests.setpoint(1.0))
    bench.controller.lost("no heartbeat")
    bench.report_battery(14.0)
    assert "land" not in bench.adapter.calls
    bench.controller.found()
    for percent in (14.0, 13.0):
        bench.report_battery(percent)
    await requests.settle()
    assert bench.adapter.calls.count("land") == 1


async def test_a_landing_is_not_broken_off_for_a_low_battery_which_is_acted_upon_after_it(
    make_bench, requests
):
    bench = make_bench(battery_policy={**POLICY, "action": "stop"})
    bench.adapter.land = bench.adapter.go.wait  # it takes its time
    landing = bench.request(requests.command("land"), waits=True)
    await requests.settle()
    bench.report_battery(14.0)
    await requests.settle()
    assert bench.telemetry_of("battery_low")
    assert bench.adapter.calls == []
    bench.adapter.go.set()
    await requests.settle()
    assert landing[-1].done
    bench.report_battery(13.0)
    await requests.settle()
    assert bench.adapter.calls == ["stop"]


@pytest.mark.parametrize("kind", ["setpoint", "command", "goal", "zero"])
async def test_what_is_refused_because_a_pilot_has_the_robot_does_not_make_it_ours(
    make_bench, requests, kind
):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.report_battery(90.0)
    bench.report_pose()
    bench.request(requests.setpoint())
    bench.controller.authority_lost("the pilot switched to POSHOLD")
    bench.adapter.raises = None if kind == "zero" else NotReady("a pilot has it")
    what = {"command": requests.command("takeoff"), "zero": requests.setpoint(0.0)}
    bench.request(what[kind] if kind in what else getattr(requests, kind)())
    await requests.settle()
    bench.report_battery(14.0)
    await requests.settle()
    assert bench.telemetry_of("battery_low")
    assert "land" not in bench.adapter.calls


async def test_a_robot_that_obeyed_after_a_pilot_had_it_is_ours_again(make_bench, requests):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.controller.authority_lost("the pilot switched to POSHOLD")
    bench.request(requests.setpoint())
    bench.report_battery(14.0)
    await requests.settle()
    assert bench.adapter.calls[-1] == "land"
