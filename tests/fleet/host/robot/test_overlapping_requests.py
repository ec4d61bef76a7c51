"""Requests to one robot that overlap: what follows a stop, a loss, a pilot or a cancellation too soon."""

import asyncio

import msgspec
import pytest

from fleet.errors import LinkLost, NotReady
from fleet.host.journal.changes import CommandEnd, NetChanges
from fleet.host.journal.journal import RobotJournal
from fleet.model.command import JointSetpoint
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import Control, GoTo, Navigate, Progress
from fleet.testing.clock import ManualClock


@pytest.mark.parametrize("given", ["zero", "velocity", "joints", "shy"])
async def test_what_does_not_move_the_robot_takes_it_from_no_pilot(bench, requests, given):
    for _ in range(2):
        bench.request(requests.setpoint())
    bench.controller.authority_lost("the pilot took over")
    bench.adapter.raises = NotReady("a pilot flies it")
    bench.clock.advance(1.0)
    ways = {
        "zero": lambda: requests.setpoint(0.0),
        "velocity": requests.setpoint,
        "joints": lambda: JointSetpoint({"elbow": 1.0}, origin=requests.setpoint().origin),
        "shy": lambda: requests.command("shy"),
    }
    bench.adapter.joint_ranges = dict
    bench.controller.can = msgspec.structs.replace(bench.controller.can, moves_joints=True)
    bench.adapter.raises = None if given == "zero" else bench.adapter.raises
    bench.request(ways[given]())
    await requests.settle()
    before = len(bench.adapter.calls)
    bench.controller.lost("no heartbeat")
    assert bench.adapter.calls[before:] == []


async def test_a_lease_that_ran_out_as_a_pilot_took_over_tells_the_robot_nothing_more(bench, requests):
    bench.request(requests.setpoint())
    bench.controller.authority_lost("the pilot took over")
    before = len(bench.adapter.calls)
    bench.controller.motion.lease_ran_out()  # on its way from the watchdog since before that
    assert bench.adapter.calls[before:] == []


@pytest.mark.parametrize("given", ["takeoff", "goal"])
async def test_what_waits_for_a_stop_does_not_begin_under_an_emergency_stop_of_another_thread(
    make_bench, requests, given
):
    bench = make_bench()
    bench.adapter.stops = "never"
    bench.request(requests.command("stop"))
    answers = bench.request(requests.command(given) if given == "takeoff" else requests.goal(), waits=True)
    await requests.settle()
    bench.controller.emergency("by a thread")  # the loop has not heard of it yet
    bench.adapter.go.set()
    await requests.settle()
    assert [call for call in bench.adapter.calls if not isinstance(call, str)] == []
    assert "emergency stop is set" in answers[-1].reason


@pytest.mark.parametrize("way", ["asked", "held again"])
async def test_a_velocity_that_an_emergency_stop_of_another_thread_overtakes_is_not_the_last_word(
    bench, requests, monkeypatch, way
):
    bench.request(requests.setpoint(0.5))
    drive = bench.adapter.drive

    def slowly(velocity):
        bench.controller.emergency("by a thread")
        drive(velocity)

    if way == "asked":
        bench.adapter.drive = slowly
        assert not bench.request(requests.setpoint(1.0))[0].ok
    else:
        bench.controller.emergency("by a thread")
        monkeypatch.setattr(
            bench.controller.guard, "limited_velocity", lambda _velocity: Velocity(Vector3(0.3))
        )
        bench.controller.reapply_velocity()
    assert bench.adapter.calls[-1] == "halt"


async def test_a_stop_that_a_newer_velocity_overtakes_says_so_and_does_not_halt_it(
    make_bench, requests, monkeypatch
):
    bench = make_bench()
    monkeypatch.setattr("fleet.host.robot.standstill.STOP_TIMEOUT", 0.01)
    bench.adapter.stops = "never"
    answers = bench.request(requests.command("stop"))
    await requests.settle()
    bench.request(requests.setpoint())
    await requests.until(lambda: answers)
    assert "driven again" in answers[0].reason
    assert bench.adapter.calls[-1] == Velocity(Vector3(1.0))


@pytest.mark.parametrize("before", ["land", "goal"])
@pytest.mark.parametrize("after", ["takeoff", "goal", "resume"])
async def test_nothing_begins_while_what_was_cancelled_still_cleans_up(bench, requests, before, after):
    cleaned = asyncio.Event()

    async def deaf(_task=None):
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            await cleaned.wait()
            bench.adapter.calls.append("cleaned")
            raise

    async def steps(task):
        yield Progress(1)
        await deaf()

    bench.adapter.land, navigate = deaf, bench.adapter.navigate
    bench.adapter.navigate = steps
    bench.request(requests.command("land") if before == "land" else requests.goal("a1"))
    await requests.settle()
    control = Control.PAUSE if after == "resume" and before == "goal" else Control.STOP
    bench.request(Navigate(control, "", requests.goal().origin))
    await requests.settle()
    bench.adapter.navigate = navigate
    bench.adapter.calls.clear()
    if control is Control.PAUSE:
        bench.request(Navigate(Control.RESUME, "", requests.goal().origin))
    else:
        bench.request(requests.command("takeoff") if after == "takeoff" else requests.goal("a2"))
    await requests.settle()
    assert bench.adapter.calls == []
    cleaned.set()
    await requests.settle()
    assert bench.adapter.calls[0] == "cleaned"
    assert len(bench.adapter.calls) == 2


async def test_what_is_asked_after_a_failed_goal_waits_until_the_robot_stands(make_bench, requests):
    bench = make_bench()
    bench.adapter.raises, bench.adapter.stops = NotReady("lost its way"), "never"
    bench.request(requests.goal())
    await requests.settle()
    bench.adapter.raises = None
    bench.request(requests.goal("a2"))
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    bench.adapter.go.set()
    await requests.settle()
    assert isinstance(bench.adapter.calls[-1], GoTo)


async def test_a_resumed_action_counts_as_motion_for_who_waits_for_a_common_start(bench, requests):
    heard = []
    bench.controller.event_reporter.heard = heard.append
    bench.request(requests.goal())
    await requests.settle()
    bench.request(Navigate(Control.PAUSE, "", requests.goal().origin))
    await requests.settle()
    heard.clear()
    bench.request(Navigate(Control.RESUME, "", requests.goal().origin))
    assert heard == ["navigate by anna"]


async def test_the_end_of_a_command_of_the_host_is_in_the_journal(make_bench, requests):
    changes = []
    bench = make_bench(journal=RobotJournal("rex", changes.append, clock=ManualClock()))
    bench.request(requests.command("release_emergency_stop", id="r1"))
    assert CommandEnd("completed", "rex", "r1") in changes


class Memory:
    """What the journal of one robot has, from process to process."""

    def __init__(self):
        self.changes = NetChanges()

    def journal(self):
        past = [*self.changes.past("rex", ())]
        return RobotJournal("rex", lambda change: self.changes.add([change]), past=past, clock=ManualClock())


@pytest.mark.parametrize("given", ["takeoff", "goal", "setpoint", "lost goal"])
async def test_what_may_be_moving_is_stopped_by_later_processes_until_it_was_seen_to_stand(
    make_bench, requests, given
):
    memory = Memory()
    bench = make_bench(journal=memory.journal())
    requested = {"takeoff": lambda: requests.command("takeoff"), "setpoint": requests.setpoint}
    bench.request(requested.get(given, lambda: requests.goal(""))())
    await requests.settle()
    if given == "lost goal":
        bench.controller.lost("silent")
    for stops, call in [(LinkLost("gone"), ["stop", "halt"]), ("", ["stop"]), ("", [])]:
        bench = make_bench(journal=memory.journal())
        bench.adapter.stops = stops
        await requests.settle()
        assert bench.adapter.calls == call


@pytest.mark.parametrize("given", ["takeoff that ended", "landing", "battery_check"])
async def test_what_moves_no_more_or_lands_is_left_alone_by_the_next_process(make_bench, requests, given):
    memory = Memory()
    bench = make_bench(journal=memory.journal())
    bench.adapter.land = asyncio.Event().wait
    bench.request(requests.command({"takeoff that ended": "takeoff", "landing": "land"}.get(given, given)))
    bench.adapter.go.set()
    await requests.settle()
    bench.controller.motion.record()
    bench = make_bench(journal=memory.journal())
    await requests.settle()
    assert bench.adapter.calls == []


async def test_lasting_motion_is_not_forgotten(make_bench, requests):
    changes = []
    clock = ManualClock()
    bench = make_bench(journal=RobotJournal("rex", changes.append, clock=clock))
    bench.request(requests.goal())
    clock.advance(3600.0)
    bench.controller.motion.record()
    bench.controller.motion.record()
    assert [change.stamp - clock.time() for change in changes if getattr(change, "name", "") == "motion"] == [
        -3600.0,
        0.0,
    ]
