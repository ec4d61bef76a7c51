"""A robot in a run obeys its run, and leaves it with whatever takes it out."""

import pytest

from fleet.model.command import ReplyStatus

REJECTED = ReplyStatus.REJECTED


def statuses(answers):
    return [answer.status for answer in answers]


async def test_a_robot_in_a_run_obeys_nobody_elses_motion(bench, requests):
    bench.request(requests.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    refused = bench.request(requests.command("takeoff", session="anna")) + bench.request(
        requests.setpoint(session="anna")
    )
    refused += bench.request(requests.goal("a1", session="anna"))
    await requests.settle()
    assert bench.adapter.calls == []
    assert {answer.reason for answer in refused} == {"it is in run 3f2a; fleet take takes it out of the run"}
    bench.request(requests.command("takeoff", session="run 3f2a"))
    await requests.settle()
    assert bench.adapter.calls == [("takeoff", None)]


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "land", "take"])
async def test_what_takes_a_robot_out_of_its_run_keeps_the_run_from_it(bench, requests, name):
    bench.request(requests.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.request(requests.command(name, session="anna"))
    await requests.settle()
    assert bench.controller.lease.run == ""
    assert "anna" in bench.controller.lease.left
    bench.adapter.calls.clear()
    late = bench.request(requests.command("takeoff", session="run 3f2a"))
    late += bench.request(requests.command("land", session="run 3f2a"))
    await requests.settle()
    assert bench.adapter.calls == []
    assert statuses(late) == [REJECTED, REJECTED]


async def test_a_run_that_stops_its_own_robot_keeps_it(bench, requests):
    bench.request(requests.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.request(requests.command("stop", session="run 3f2a"))
    await requests.settle()
    assert bench.controller.lease.run == "3f2a"
    bench.request(requests.command("leave_run", data={"run": "other"}, session="run other"))
    assert bench.controller.lease.run == "3f2a"
    bench.request(requests.command("leave_run", data={"run": "3f2a"}, session="run 3f2a"))
    assert bench.controller.lease.run == ""


async def test_a_robot_that_somebody_drives_joins_no_run(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    (answer,) = bench.request(requests.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    assert "anna has control" in answer.reason


async def test_a_pilot_takes_a_robot_out_of_its_run(bench, requests):
    bench.request(requests.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.controller.authority_lost("pilot")
    assert bench.controller.lease.left == "taken: authority lost: pilot"
