"""A robot that this edge moves is brought to a standstill: at the end of a lease, and after it was lost."""

import pytest

from fleet.errors import LinkLost, NotReady
from fleet.host.journal.journal import RobotJournal
from fleet.host.journal.past_commands import PastCommand
from fleet.model.command import ReplyStatus
from fleet.model.geometry import ZERO_VELOCITY

ACCEPTED, REJECTED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for an emergency halt to be written, on however busy a machine."""
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)


def statuses(answers):
    return [answer.status for answer in answers]


async def test_a_lease_that_ran_out_ends_in_zero_velocity(bench, requests):
    bench.request(requests.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[-1] == ZERO_VELOCITY


async def test_a_fresh_setpoint_is_not_undone_by_the_lease_before_it(bench, requests):
    bench.request(requests.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.request(requests.setpoint(x=0.5))
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[-1].linear.x == 0.5


async def test_a_lease_that_ran_out_does_not_disturb_a_goal_that_came_meanwhile(bench, requests):
    bench.request(requests.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.request(requests.goal())
    await requests.settle()
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[1:] == [ZERO_VELOCITY, requests.goal().instruction]


async def test_a_robot_that_is_lost_fails_what_was_under_way_and_takes_nothing_up_again(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.controller.lost("no heartbeat")
    bench.controller.found()
    await requests.settle()
    assert bench.statuses() == ["queued", "running", "failed"]
    assert not bench.controller.in_motion


async def test_a_stop_that_raises_is_followed_by_a_halt(bench, requests):
    bench.adapter.stops = LinkLost("no answer")
    answers = bench.request(requests.command("stop"))
    await requests.settle()
    assert statuses(answers) == [ReplyStatus.TIMEOUT]
    assert bench.adapter.calls[-1] == "halt"


async def test_a_stop_that_never_returns_is_cut_off_and_said_so(bench, requests, monkeypatch):
    monkeypatch.setattr("fleet.host.robot.standstill.STOP_TIMEOUT", 0.01)
    bench.adapter.stops = "never"
    answers = bench.request(requests.command("stop"))
    await requests.until(lambda: answers)
    bench.adapter.go.set()
    assert answers[0].status is ReplyStatus.TIMEOUT
    assert bench.adapter.calls[-1] == "halt"


async def test_a_stop_while_it_is_stopping_is_answered_too(bench, requests):
    answers = [bench.request(requests.command(name)) for name in ("stop", "stop", "emergency_stop")]
    await requests.settle()
    assert [statuses(one) for one in answers] == [[ACCEPTED]] * 3
    assert bench.adapter.calls.count("stop") == 3


async def test_a_robot_that_somebody_else_moves_is_not_touched_when_it_is_lost(bench, requests):
    bench.controller.lost("no heartbeat")
    assert bench.adapter.calls == []


async def test_a_robot_that_we_moved_is_halted_when_it_is_lost(bench, requests):
    bench.request(requests.setpoint())
    bench.controller.lost("no heartbeat")
    assert bench.adapter.calls[-1] == "halt"


async def test_what_is_asked_after_a_failure_waits_until_the_robot_stands(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.adapter.calls.clear()
    bench.request(requests.command("shy"))
    await requests.settle()
    bench.request(requests.command("takeoff"))
    await requests.settle()
    assert bench.adapter.calls.index("stop") < bench.adapter.calls.index(("takeoff", None))
    assert bench.adapter.calls[-1] == ("takeoff", None)


@pytest.mark.parametrize("given", ["goal", "setpoint", "takeoff"])
@pytest.mark.parametrize("back", ["found", "faulted"])
async def test_a_robot_that_was_lost_while_it_moved_is_stopped_when_it_is_back(bench, requests, given, back):
    bench.request(requests.command(given) if given == "takeoff" else getattr(requests, given)())
    await requests.settle()
    bench.controller.lost("no heartbeat")
    before = len(bench.adapter.calls)
    getattr(bench.controller, back)(*["a leg is hot"] * (back == "faulted"))
    bench.controller.found()
    await requests.settle()
    assert [call for call in bench.adapter.calls[before:] if call != "halt"] == ["stop"]


async def test_it_is_stopped_by_the_next_run_too(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.controller.detach("the port is gone")
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls[-2:] == ["halt", "stop"]


async def test_a_stop_that_the_loss_broke_off_is_begun_anew(bench, requests):
    bench.request(requests.goal())
    bench.adapter.stops = "never"
    bench.request(requests.command("stop"))
    await requests.settle()
    bench.controller.lost("no heartbeat")
    bench.adapter.stops = ""
    bench.adapter.go.set()
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls.count("stop") == 2


@pytest.mark.parametrize("stops", [LinkLost("gone"), NotReady("busy"), "never"])
@pytest.mark.parametrize("ended_by", ["a stop", "its own failure"])
async def test_a_robot_whose_stop_was_not_seen_before_it_was_lost_is_stopped_when_it_is_back(
    bench, requests, ended_by, stops
):
    bench.adapter.stops = stops
    bench.adapter.raises = LinkLost("gone") if ended_by == "its own failure" else None
    bench.request(requests.goal())
    await requests.settle()
    if ended_by == "a stop":
        bench.request(requests.command("stop"))
        await requests.settle()
    assert not bench.controller.in_motion
    bench.controller.lost("no heartbeat")
    before = len(bench.adapter.calls)
    bench.adapter.stops, bench.adapter.raises = "", None
    bench.adapter.go.set()
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls[before:] == ["stop"]


async def test_a_robot_that_did_what_was_asked_after_a_stop_failed_is_left_alone_when_it_is_back(
    bench, requests
):
    bench.adapter.stops = NotReady("busy")
    bench.request(requests.command("stop"))
    await requests.settle()
    bench.adapter.go.set()
    bench.request(requests.goal())
    await requests.settle()
    before = len(bench.adapter.calls)
    bench.controller.lost("no heartbeat")
    bench.controller.found()
    await requests.settle()
    assert "stop" not in bench.adapter.calls[before:]


async def test_one_that_is_lost_again_before_it_was_seen_to_stand_is_stopped_once_more(make_bench, requests):
    bench = make_bench()
    bench.request(requests.goal())
    await requests.settle()
    bench.controller.detach("the port is gone")
    bench.adapter.stops = "never"
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await requests.settle()
    bench.controller.detach("it is gone again")
    bench.adapter.stops = ""
    bench.adapter.go.set()
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls.count("stop") == 2


@pytest.mark.parametrize(("since", "stopped"), [(3.0, ["stop"]), (60.0, [])])
async def test_one_that_may_not_have_heard_the_end_of_its_velocity_is_stopped_when_it_is_back(
    bench, requests, since, stopped
):
    bench.request(requests.setpoint())
    bench.clock.advance(0.6)
    assert bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.halt()
    bench.controller.motion.lease_ran_out()
    bench.clock.advance(since)
    bench.controller.lost("silent")
    before = len(bench.adapter.calls)
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls[before:] == stopped


@pytest.mark.parametrize("ended_by", ["a zero", "a late zero", "a fault"])
async def test_one_whose_goal_ended_without_a_stop_before_it_was_lost_is_stopped_when_it_is_back(
    bench, requests, ended_by
):
    bench.request(requests.goal())
    await requests.settle()
    if ended_by == "a fault":
        bench.controller.faulted("a leg is hot")
    else:
        bench.request(requests.setpoint(0.0, stamp=None if ended_by == "a zero" else 0.0))
    bench.clock.advance(3.0)
    bench.controller.lost("silent")
    before = len(bench.adapter.calls)
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls[before:] == ["stop"]


async def test_one_that_was_seen_to_stand_since_its_last_velocity_is_left_alone_when_it_is_back(
    bench, requests
):
    bench.request(requests.setpoint())
    bench.request(requests.command("stop"))
    await requests.settle()
    bench.controller.lost("silent")
    bench.controller.found()
    await requests.settle()
    assert bench.adapter.calls.count("stop") == 1


@pytest.mark.parametrize("meanwhile", ["nothing", "land", "pilot"])
async def test_one_that_stood_or_landed_or_has_a_pilot_is_left_alone_when_it_is_back(
    bench, requests, meanwhile
):
    bench.adapter.land = bench.adapter.go.wait  # it takes its time
    bench.request(requests.command("land" if meanwhile == "land" else "takeoff"))
    await requests.settle()
    if meanwhile == "nothing":
        bench.adapter.go.set()
        await requests.settle()
    bench.controller.lost("no heartbeat")
    if meanwhile == "pilot":
        bench.controller.authority_lost("the pilot switched to POSHOLD")
    bench.controller.found()
    await requests.settle()
    assert "stop" not in bench.adapter.calls


async def test_what_an_earlier_process_left_moving_is_stopped(make_bench, requests):
    journal = RobotJournal(past=[PastCommand("a1", "navigate", action=True, outcome="")])
    bench = make_bench(journal=journal)
    await requests.settle()
    assert bench.adapter.calls == ["stop"]


async def test_a_stop_of_a_robot_that_is_lost_meanwhile_is_not_reported_as_done(bench, requests):
    bench.adapter.stops = "never"
    answers = bench.request(requests.command("stop"), waits=True)
    await requests.settle()
    bench.controller.lost("no heartbeat")
    bench.adapter.go.set()
    await requests.settle()
    assert statuses(answers) == [REJECTED]
    assert "no heartbeat" in answers[0].reason


@pytest.mark.parametrize(("setpoints", "level"), [(1, "INFO"), (2, "WARNING")])
async def test_only_a_stream_whose_lease_ran_out_is_warned_of(bench, requests, caplog, setpoints, level):
    caplog.set_level("INFO")
    for _ in range(setpoints):
        bench.request(requests.setpoint())
        bench.clock.advance(0.1)
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.motion.lease_ran_out()
    said = [record for record in caplog.records if "lease" in record.message]
    assert [record.levelname for record in said] == [level]
