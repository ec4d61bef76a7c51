"""Goals and the controls of an action: each has exactly one end, and a repeat begins nothing anew."""

from fleet.errors import LinkLost
from fleet.model.command import ReplyStatus
from fleet.model.navigation import Control, Navigate

REJECTED = ReplyStatus.REJECTED


def statuses(answers):
    return [answer.status for answer in answers]


def control(requests, what, action=""):
    return Navigate(what, action, requests.command("x").origin)


async def test_a_goal_goes_through_its_states_to_exactly_one_end(bench, requests):
    answers = bench.request(requests.goal(), waits=True)
    await requests.settle()
    bench.adapter.go.set()
    await requests.settle()
    assert bench.statuses() == ["queued", "running", "completed"]
    assert [answer.done for answer in answers] == [None, True]


async def test_a_newer_goal_cancels_the_older(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(requests.goal("a2"))
    await requests.settle()
    ended = [(report.action_id, report.state) for report in bench.reports if report.state.terminal]
    assert ended == [("a1", "cancelled")]


async def test_a_goal_from_another_waits_for_the_one_who_drives(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    answers = bench.request(requests.goal(session="bert"))
    assert statuses(answers) == [REJECTED]
    assert bench.statuses() == ["failed"]


async def test_a_repeated_action_id_is_answered_with_its_last_status(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(requests.goal("a1"))
    await requests.settle()
    assert len([call for call in bench.adapter.calls if call != "halt"]) == 1
    assert bench.statuses() == ["queued", "running", "running"]


async def test_stopping_cancels_the_action_and_completes_the_stop(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(control(requests, Control.STOP, "s1"))
    await requests.settle()
    ended = {report.action_id: str(report.state) for report in bench.reports if report.state.terminal}
    assert ended == {"a1": "cancelled", "s1": "completed"}
    assert bench.adapter.calls[-1] == "stop"


async def test_a_paused_action_holds_and_goes_on_when_resumed(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(control(requests, Control.PAUSE))
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    bench.request(control(requests, Control.RESUME))
    bench.adapter.go.set()
    await requests.settle()
    assert bench.statuses()[-1] == "completed"


async def test_resuming_nothing_is_refused(bench, requests):
    assert statuses(bench.request(control(requests, Control.RESUME))) == [REJECTED]


async def test_a_failed_goal_stops_the_robot_and_says_why(bench, requests):
    bench.adapter.raises = LinkLost("the cable came out")
    bench.request(requests.goal())
    await requests.settle()
    assert bench.reports[-1].message == "the cable came out"
    assert bench.adapter.calls[-1] == "stop"


async def test_a_stop_with_the_actions_own_id_is_no_repeat_of_the_action(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(control(requests, Control.STOP, "a1"))
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert bench.statuses() == ["queued", "running", "cancelled"]


async def test_a_goal_during_a_takeoff_is_refused_whatever_is_asked_in_between(bench, requests):
    bench.request(requests.command("takeoff"))
    for between in ([], [requests.command("arm")], [requests.goal("one"), requests.command("arm")]):
        for request in between:
            bench.request(request)
            await requests.settle()
        answers = bench.request(requests.goal())
        await requests.settle()
        assert [answer.reason for answer in answers if answer.reason] == ["busy with takeoff"]


async def test_a_resume_that_is_delivered_again_does_not_go_on_after_the_next_pause(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    for _ in range(2):
        bench.request(control(requests, Control.PAUSE))
        await requests.settle()
        bench.request(control(requests, Control.RESUME, "r1"))
        await requests.settle()
    assert len([call for call in bench.adapter.calls if hasattr(call, "goal")]) == 2


async def test_a_goal_that_was_refused_does_not_begin_when_it_is_delivered_again(bench, requests):
    bench.controller.lost("no heartbeat")
    bench.request(requests.goal("a1"))
    bench.controller.found()
    answers = bench.request(requests.goal("a1"))
    await requests.settle()
    assert statuses(answers) == [REJECTED]
    assert bench.statuses() == ["failed", "failed"]


async def test_a_resume_that_is_refused_says_nothing_of_the_action_it_names(bench, requests):
    bench.request(requests.goal("a1"))
    await requests.settle()
    bench.request(control(requests, Control.RESUME, "a1"))
    assert bench.statuses() == ["queued", "running"]


async def test_a_stop_is_completed_when_the_robot_stands_and_not_before(bench, requests):
    bench.request(control(requests, Control.STOP, "s1"))
    assert bench.statuses() == []
    await requests.settle()
    assert bench.statuses() == ["completed"]
