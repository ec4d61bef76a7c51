import logging
import threading

import msgspec
import pytest

from fleet.errors import LinkLost, NotReady
from fleet.host.journal.journal import RobotJournal
from fleet.host.journal.past_commands import PastCommand
from fleet.model.command import ReplyStatus
from fleet.model.geometry import ZERO_VELOCITY
from fleet.model.navigation import Control, Navigate
from fleet.wire.stops import STOP_WORDS

ACCEPTED, REJECTED, DENIED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED, ReplyStatus.DENIED


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for an emergency halt to be written, on however busy a machine."""
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)


def statuses(answers):
    return [answer.status for answer in answers]


async def test_a_command_reaches_the_robot_and_is_answered_once(bench, asks):
    answers = bench.ask(asks.command("land"))
    await asks.settle()
    assert bench.adapter.calls == ["land"]
    assert statuses(answers) == [ACCEPTED]


async def test_who_waits_also_hears_that_it_is_done(bench, asks):
    answers = bench.ask(asks.command("takeoff", data={"altitude": 3}), waits=True)
    await asks.settle()
    assert [answer.done for answer in answers] == [None]
    bench.adapter.go.set()
    await asks.settle()
    assert [answer.done for answer in answers] == [None, True]


@pytest.mark.parametrize("source", [None, "edge", "sim", "sim_tele", "edit", "nonsense"])
async def test_a_command_from_a_wrong_source_never_reaches_the_robot(bench, asks, source):
    answers = bench.ask(asks.command("land", source=source)) + bench.ask(asks.setpoint(source=source))
    await asks.settle()
    assert bench.adapter.calls == []
    assert statuses(answers) == [REJECTED, REJECTED]


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "hover"])
async def test_a_stop_is_obeyed_from_anyone_however_old(bench, asks, name):
    answers = bench.ask(asks.command(name, source=None, stamp=1.0))
    await asks.settle()
    assert "stop" in bench.adapter.calls
    assert statuses(answers) == [ACCEPTED]


async def test_an_undeclared_command_is_refused_with_the_nearest(bench, asks):
    (answer,) = bench.ask(asks.command("take_off"))
    assert answer.status is REJECTED
    assert "takeoff" in answer.hint


async def test_what_this_robot_lacks_is_refused_with_the_reason_and_its_drive_goes_on(bench, asks):
    lacking = {"takeoff": "it has wheels", "move_backward": "it has no reverse", "goto": "it knows no place"}
    bench.controller.can = msgspec.structs.replace(bench.controller.can, lacking=lacking)
    bench.ask(asks.setpoint(1.0))
    (takeoff,) = bench.ask(asks.command("takeoff"))
    (back,) = bench.ask(asks.setpoint(-1.0))
    answers = bench.ask(asks.goal())
    await asks.settle()
    assert (takeoff.status, takeoff.hint) == (REJECTED, "it has wheels")
    assert (back.status, back.reason) == (REJECTED, "it has no reverse")
    assert "it knows no place" in answers[0].reason
    assert [each.linear.x for each in bench.adapter.calls] == [1.0]
    assert bench.controller.in_motion


async def test_a_wrong_argument_is_refused_by_name(bench, asks):
    answers = bench.ask(asks.command("takeoff", data={"altitud": 3}))
    await asks.settle()
    assert "altitude" in answers[0].hint
    assert bench.adapter.calls == []


async def test_the_robots_own_words_come_back(bench, asks):
    answers = bench.ask(asks.command("shy"))
    await asks.settle()
    assert (answers[0].status, answers[0].reason) == (DENIED, "not today")
    assert answers[0].messages == ("Arm: no GPS",)


async def test_a_repeated_command_is_done_once_and_answered_alike(bench, asks):
    first = bench.ask(asks.command("land", id="r1"))
    await asks.settle()
    second = bench.ask(asks.command("land", id="r1"))
    await asks.settle()
    assert bench.adapter.calls == ["land"]
    assert first == second


async def test_a_stale_setpoint_is_refused(bench, asks):
    answers = bench.ask(asks.setpoint(stamp=bench.clock.time() - 30))
    assert statuses(answers) == [REJECTED]
    assert bench.adapter.calls == []


@pytest.mark.parametrize("stamp", [-3600.0, -30.0, -0.6, 0.5, 60.0])
async def test_a_zero_ends_motion_however_late_or_early_its_stamp_is(bench, asks, stamp):
    bench.ask(asks.setpoint(stamp=bench.clock.time()))
    assert bench.controller.deadman.armed
    zero = asks.setpoint(x=0.0, stamp=bench.clock.time() + stamp)
    assert statuses(bench.ask(zero)) == [ACCEPTED]
    assert bench.adapter.calls[-1] == ZERO_VELOCITY
    assert not bench.controller.in_motion
    bench.ask(asks.goal())
    await asks.settle()
    assert statuses(bench.ask(asks.setpoint(x=0.0, stamp=bench.clock.time() + stamp))) == [ACCEPTED]
    await asks.settle()
    assert not bench.controller.in_motion


@pytest.mark.parametrize("stamp", [None, 0.0, -30.0])
async def test_a_zero_ends_motion_while_nothing_may_move_the_robot(bench, asks, stamp):
    bench.ask(asks.setpoint(lease=5.0))
    bench.controller.latch.held = "the edge, which reads its stop input, is silent"
    assert statuses(bench.ask(asks.setpoint())) == [REJECTED]
    zero = asks.setpoint(x=0.0, stamp=None if stamp is None else bench.clock.time() + stamp)
    assert statuses(bench.ask(zero)) == [ACCEPTED]
    assert bench.adapter.calls[-1] == ZERO_VELOCITY
    assert not bench.controller.in_motion


async def test_a_late_zero_tells_a_robot_that_stands_nothing(bench, asks):
    bench.ask(asks.setpoint(x=0.0, stamp=bench.clock.time() - 30))
    assert bench.adapter.calls == []
    assert not bench.controller.motion.in_control


async def test_a_late_zero_ends_no_take_off_and_nothing_that_another_drives(bench, asks):
    bench.ask(asks.command("takeoff"))
    await asks.settle()
    (answer,) = bench.ask(asks.setpoint(x=0.0, stamp=bench.clock.time() - 30))
    assert answer.reason == "busy with takeoff; send stop first"
    bench.ask(asks.command("stop"))
    await asks.settle()
    bench.clock.advance(5.0)
    bench.ask(asks.setpoint(session="bert"))
    (answer,) = bench.ask(asks.setpoint(x=0.0, session="anna", stamp=bench.clock.time() - 30))
    assert answer.reason == "bert has control for 3.0 s more"
    assert bench.controller.deadman.armed


async def test_a_late_zero_of_one_key_starts_none_that_it_held_back(bench, make_bench, asks, monkeypatch):
    monkeypatch.setattr(type(bench.adapter), "combines_keys", True, raising=False)
    bench = make_bench()
    now = bench.clock.time()
    for verb, x in (("move_forward", 1.0), ("move_backward", -1.0)):
        bench.ask(msgspec.structs.replace(asks.setpoint(x=x, stamp=now), name=verb))
    before = len(bench.adapter.calls)
    bench.ask(msgspec.structs.replace(asks.setpoint(x=0.0, stamp=now - 3), name="move_backward"))
    assert all(call == ZERO_VELOCITY for call in bench.adapter.calls[before:])
    assert not bench.controller.in_motion


async def test_a_setpoint_is_clamped_and_held_for_its_lease(bench, asks):
    bench.ask(asks.setpoint(x=50.0))
    assert bench.adapter.calls[0].linear.x == pytest.approx(2.0)
    bench.clock.advance(0.49)
    assert not bench.controller.deadman.expire(bench.clock.monotonic())
    bench.clock.advance(0.02)
    assert bench.controller.deadman.expire(bench.clock.monotonic())


async def test_a_lease_that_ran_out_ends_in_zero_velocity(bench, asks):
    bench.ask(asks.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[-1] == ZERO_VELOCITY


@pytest.mark.parametrize(("setpoints", "level"), [(1, "INFO"), (2, "WARNING")])
async def test_only_a_stream_whose_lease_ran_out_is_warned_of(bench, asks, caplog, setpoints, level):
    caplog.set_level("INFO")
    for _ in range(setpoints):
        bench.ask(asks.setpoint())
        bench.clock.advance(0.1)
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.motion.lease_ran_out()
    said = [record for record in caplog.records if "lease" in record.message]
    assert [record.levelname for record in said] == [level]


async def test_a_fresh_setpoint_is_not_undone_by_the_lease_before_it(bench, asks):
    bench.ask(asks.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.ask(asks.setpoint(x=0.5))
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[-1].linear.x == 0.5


async def test_a_second_operator_waits_for_the_control_lease(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    assert statuses(bench.ask(asks.setpoint(session="bert"))) == [REJECTED]
    bench.clock.advance(3.1)
    assert statuses(bench.ask(asks.setpoint(session="bert"))) == [ACCEPTED]


async def test_an_operator_who_stops_lets_go_of_the_robot(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    bench.ask(asks.command("stop", session="bert"))
    assert statuses(bench.ask(asks.setpoint(session="bert"))) == [REJECTED]
    bench.ask(asks.command("stop", session="anna"))
    assert statuses(bench.ask(asks.setpoint(session="bert"))) == [ACCEPTED]


async def test_a_stick_that_is_held_does_not_undo_somebody_else_s_stop(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    bench.ask(asks.command("stop", session="bert"))
    for _ in range(20):
        bench.clock.advance(0.1)
        (answer,) = bench.ask(asks.setpoint(session="anna"))
        assert "another sender stopped it" in answer.reason
    assert not bench.controller.in_motion
    bench.clock.advance(0.6)
    assert statuses(bench.ask(asks.setpoint(session="anna"))) == [ACCEPTED]


async def test_an_emergency_stop_is_latched_until_it_is_released(bench, asks):
    bench.ask(asks.command("emergency_stop", source=None))
    await asks.settle()
    assert bench.adapter.calls[0] == "halt"
    refused = bench.ask(asks.setpoint()) + bench.ask(asks.command("takeoff")) + bench.ask(asks.goal())
    assert statuses(refused) == [REJECTED] * 3
    bench.ask(asks.command("release_emergency_stop"))
    assert statuses(bench.ask(asks.setpoint())) == [ACCEPTED]


async def test_an_emergency_stop_is_reported_only_once_the_orderly_stop_is_under_way(bench, asks):
    """A log or a bus that is held up there would keep everything before it waiting."""
    seen = []

    class Slow(logging.Handler):
        def emit(self, record):
            if record.levelno == logging.CRITICAL:
                seen.append((bench.controller.in_motion, bench.controller.motion.executor.stopping))

    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.event_reporter.log.addHandler(slow := Slow())
    try:
        bench.ask(asks.command("emergency_stop"))
    finally:
        bench.controller.event_reporter.log.removeHandler(slow)
    assert seen == [(False, True)]


async def test_landing_is_allowed_while_an_emergency_stop_is_latched(bench, asks):
    bench.controller.emergency("test")
    answers = bench.ask(asks.command("land"))
    await asks.settle()
    assert statuses(answers) == [ACCEPTED]


async def test_the_release_needs_an_accepted_source(bench, asks):
    bench.controller.emergency("test")
    bench.ask(asks.command("release_emergency_stop", source="sim"))
    assert bench.controller.latched


async def test_a_newer_moving_command_takes_the_place_of_the_older(bench, asks):
    older = bench.ask(asks.command("takeoff"), waits=True)
    await asks.settle()
    bench.ask(asks.command("land"))
    await asks.settle()
    assert older[-1].done is False
    assert older[-1].reason == "superseded by land"


@pytest.mark.parametrize("doing", ["takeoff", "goto", "driving"])
async def test_arming_takes_the_place_of_nothing_that_moves(bench, asks, doing):
    ask = {"takeoff": asks.command("takeoff"), "goto": asks.goal(), "driving": asks.setpoint()}[doing]
    older = bench.ask(ask, waits=True)
    await asks.settle()
    (answer,) = bench.ask(asks.command("arm"))
    await asks.settle()
    assert (answer.status, answer.reason.partition(" ")[0]) == (REJECTED, "busy")
    assert older[-1].done is not False
    assert bench.controller.in_motion


async def test_a_goal_during_a_takeoff_is_refused_whatever_is_asked_in_between(bench, asks):
    bench.ask(asks.command("takeoff"))
    for between in ([], [asks.command("arm")], [asks.goal("one"), asks.command("arm")]):
        for ask in between:
            bench.ask(ask)
            await asks.settle()
        answers = bench.ask(asks.goal())
        await asks.settle()
        assert [answer.reason for answer in answers if answer.reason] == ["busy with takeoff"]


async def test_arming_a_robot_that_does_nothing_is_carried_out(bench, asks):
    answers = bench.ask(asks.command("arm"))
    await asks.settle()
    assert statuses(answers) == [ACCEPTED]


async def test_a_setpoint_does_not_disturb_a_takeoff(bench, asks):
    bench.ask(asks.command("takeoff"))
    await asks.settle()
    (answer,) = bench.ask(asks.setpoint())
    assert "takeoff" in answer.reason
    assert bench.adapter.calls == [("takeoff", None)]


async def test_a_stop_ends_a_takeoff(bench, asks):
    older = bench.ask(asks.command("takeoff"), waits=True)
    await asks.settle()
    bench.ask(asks.command("stop"))
    await asks.settle()
    assert older[-1].done is False
    assert bench.adapter.calls[-1] == "stop"


async def test_an_offline_robot_is_asked_nothing_but_is_still_halted(bench, asks):
    bench.controller.lost("no heartbeat")
    bench.adapter.calls.clear()
    answers = bench.ask(asks.command("land")) + bench.ask(asks.setpoint()) + bench.ask(asks.command("stop"))
    await asks.settle()
    assert statuses(answers) == [REJECTED] * 3
    assert all("no heartbeat" in answer.reason for answer in answers)
    assert bench.adapter.calls == ["halt"]


async def test_a_robot_that_is_lost_fails_what_was_under_way_and_takes_nothing_up_again(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.lost("no heartbeat")
    bench.controller.found()
    await asks.settle()
    assert bench.statuses() == ["queued", "running", "failed"]
    assert not bench.controller.in_motion


async def test_an_adapter_that_refuses_a_velocity_leaves_nothing_armed(bench, asks):
    bench.adapter.raises = NotReady("not in the air")
    (answer,) = bench.ask(asks.setpoint())
    assert (answer.status, answer.reason) == (DENIED, "not in the air")
    assert not bench.controller.deadman.armed


@pytest.mark.parametrize("kind", ["command", "setpoint", "goal"])
async def test_an_adapter_that_raises_anything_is_reported_to_the_runner(bench, asks, kind):
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.ask(asks.command("takeoff") if kind == "command" else getattr(asks, kind)())
    await asks.settle()
    assert [type(crash) for crash in bench.crashes] == [ZeroDivisionError]


async def test_authority_lost_ends_everything_and_is_reported(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.authority_lost("the pilot switched to POSHOLD")
    assert len(bench.telemetry_of("authority_lost")) == 1
    assert bench.statuses()[-1] == "failed"
    assert not bench.controller.motion.in_control


async def test_a_goal_goes_through_its_states_to_exactly_one_end(bench, asks):
    answers = bench.ask(asks.goal(), waits=True)
    await asks.settle()
    bench.adapter.go.set()
    await asks.settle()
    assert bench.statuses() == ["queued", "running", "completed"]
    assert [answer.done for answer in answers] == [None, True]


async def test_a_newer_goal_cancels_the_older(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(asks.goal("a2"))
    await asks.settle()
    ended = [(report.action_id, report.state) for report in bench.reports if report.state.terminal]
    assert ended == [("a1", "cancelled")]


async def test_teleoperation_takes_over_from_navigation(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.ask(asks.setpoint())
    assert bench.statuses()[-1] == "cancelled"
    assert bench.adapter.calls[-1].linear.x == 1.0


async def test_a_goal_from_another_waits_for_the_one_who_drives(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    answers = bench.ask(asks.goal(session="bert"))
    assert statuses(answers) == [REJECTED]
    assert bench.statuses() == ["failed"]


async def test_a_repeated_action_id_is_answered_with_its_last_status(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(asks.goal("a1"))
    await asks.settle()
    assert len([call for call in bench.adapter.calls if call != "halt"]) == 1
    assert bench.statuses() == ["queued", "running", "running"]


def control(asks, what, action=""):
    return Navigate(what, action, asks.command("x").origin)


async def test_stopping_cancels_the_action_and_completes_the_stop(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(control(asks, Control.STOP, "s1"))
    await asks.settle()
    ended = {report.action_id: str(report.state) for report in bench.reports if report.state.terminal}
    assert ended == {"a1": "cancelled", "s1": "completed"}
    assert bench.adapter.calls[-1] == "stop"


async def test_a_paused_action_holds_and_goes_on_when_resumed(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(control(asks, Control.PAUSE))
    await asks.settle()
    assert bench.adapter.calls[-1] == "stop"
    bench.ask(control(asks, Control.RESUME))
    bench.adapter.go.set()
    await asks.settle()
    assert bench.statuses()[-1] == "completed"


async def test_resuming_nothing_is_refused(bench, asks):
    assert statuses(bench.ask(control(asks, Control.RESUME))) == [REJECTED]


async def test_a_failed_goal_stops_the_robot_and_says_why(bench, asks):
    bench.adapter.raises = LinkLost("the cable came out")
    bench.ask(asks.goal())
    await asks.settle()
    assert bench.reports[-1].message == "the cable came out"
    assert bench.adapter.calls[-1] == "stop"


# -- what must not leave the robot moving ----------------------------------------------------------------


async def test_a_stop_with_the_actions_own_id_is_no_repeat_of_the_action(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(control(asks, Control.STOP, "a1"))
    await asks.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert bench.statuses() == ["queued", "running", "cancelled"]


async def test_a_velocity_that_the_robot_refuses_ends_the_one_before_it(bench, asks):
    bench.ask(asks.setpoint())
    bench.adapter.raises = NotReady("no sideways")
    bench.ask(asks.setpoint(x=0.5))
    assert bench.adapter.calls[-1] == "halt"
    assert not bench.controller.deadman.armed


async def test_a_velocity_that_is_refused_after_taking_over_from_navigation_ends_in_a_halt(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.adapter.raises = NotReady("not in this mode")
    bench.ask(asks.setpoint())
    assert bench.adapter.calls[-1] == "halt"


async def test_a_velocity_that_is_refused_at_rest_touches_nothing(bench, asks):
    bench.adapter.raises = NotReady("not in the air")
    bench.ask(asks.setpoint())
    assert bench.adapter.calls == []


async def test_an_adapter_that_crashes_in_a_velocity_is_halted_at_once(bench, asks):
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.ask(asks.setpoint())
    assert bench.adapter.calls == ["halt"]


async def test_a_command_that_is_refused_after_it_ended_an_action_holds_the_robot(bench, asks, caplog):
    bench.ask(asks.goal())
    await asks.settle()
    bench.ask(asks.command("shy"))
    await asks.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert "shy failed: not today: it is brought to a standstill" in caplog.text


async def test_a_command_with_data_that_it_does_not_take_breaks_nothing_off(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    before = list(bench.adapter.calls)
    (answer,) = bench.ask(asks.command("takeoff", data={"no_such": 1}))
    await asks.settle()
    assert answer.status is DENIED
    assert bench.adapter.calls == before


async def test_a_command_that_is_refused_at_rest_does_not_move_the_robot_at_all(bench, asks):
    bench.ask(asks.command("shy"))
    await asks.settle()
    assert bench.adapter.calls == []


async def test_a_command_that_the_robot_took_and_then_failed_ends_in_a_stop(bench, asks):
    bench.ask(asks.command("takeoff"))
    await asks.settle()
    bench.adapter.raises = NotReady("a motor is weak")
    bench.adapter.go.set()
    await asks.settle()
    assert bench.adapter.calls[-1] == "stop"


async def test_a_stop_that_raises_is_followed_by_a_halt(bench, asks):
    bench.adapter.stops = LinkLost("no answer")
    answers = bench.ask(asks.command("stop"))
    await asks.settle()
    assert statuses(answers) == [ReplyStatus.TIMEOUT]
    assert bench.adapter.calls[-1] == "halt"


async def test_a_stop_that_never_returns_is_cut_off_and_said_so(bench, asks, monkeypatch):
    monkeypatch.setattr("fleet.host.robot.standstill.STOP_TIMEOUT", 0.01)
    bench.adapter.stops = "never"
    answers = bench.ask(asks.command("stop"))
    await asks.until(lambda: answers)
    bench.adapter.go.set()
    assert answers[0].status is ReplyStatus.TIMEOUT
    assert bench.adapter.calls[-1] == "halt"


async def test_a_stop_while_it_is_stopping_is_answered_too(bench, asks):
    answers = [bench.ask(asks.command(name)) for name in ("stop", "stop", "emergency_stop")]
    await asks.settle()
    assert [statuses(one) for one in answers] == [[ACCEPTED]] * 3
    assert bench.adapter.calls.count("stop") == 3


@pytest.mark.parametrize("method", ["emergency", "halt"])
async def test_a_halt_that_raises_stays_inside(bench, asks, method):
    bench.adapter.halts = ZeroDivisionError("oops")
    {"emergency": lambda: bench.controller.emergency("test"), "halt": bench.controller.halt}[method]()
    bench.ask(asks.command("stop"))
    await asks.settle()
    assert bench.adapter.calls[-1] == "stop"


@pytest.mark.parametrize("reachable", [True, False])
async def test_an_emergency_halt_that_hangs_keeps_neither_the_latch_nor_the_loop(
    bench, asks, reachable, monkeypatch
):
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 0.01)
    free, held = threading.Event(), []
    bench.adapter.emergency_halt = bench.adapter.halt = lambda: held.append(free.wait(20))
    if not reachable:
        bench.controller.lost("no heartbeat")
    answers = bench.ask(asks.command("emergency_stop"))
    assert bench.controller.latched
    await asks.settle()
    assert held == []
    assert bench.adapter.calls == ["stop"] * reachable
    assert statuses(answers) == [ACCEPTED if reachable else REJECTED]
    free.set()
    await asks.until(lambda: len(held) == (1 if reachable else 2))


async def test_a_robot_that_somebody_else_moves_is_not_touched_when_it_is_lost(bench, asks):
    bench.controller.lost("no heartbeat")
    assert bench.adapter.calls == []


async def test_a_robot_that_we_moved_is_halted_when_it_is_lost(bench, asks):
    bench.ask(asks.setpoint())
    bench.controller.lost("no heartbeat")
    assert bench.adapter.calls[-1] == "halt"


async def test_a_lease_that_ran_out_does_not_disturb_a_goal_that_came_meanwhile(bench, asks):
    bench.ask(asks.setpoint())
    bench.clock.advance(1.0)
    bench.controller.deadman.expire(bench.clock.monotonic())
    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.motion.lease_ran_out()
    assert bench.adapter.calls[1:] == [ZERO_VELOCITY, asks.goal().ask]


# -- repeats ---------------------------------------------------------------------------------------------


async def test_a_repeat_of_what_is_still_under_way_gets_the_same_answers(bench, asks):
    first = bench.ask(asks.command("takeoff", id="r1"), waits=True)
    again = bench.ask(asks.command("takeoff", id="r1"), waits=True)
    await asks.settle()
    bench.adapter.go.set()
    await asks.settle()
    assert [answer.done for answer in again] == [None, True]
    assert first == again


async def test_a_command_that_was_refused_is_not_done_when_it_is_delivered_again(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    bench.ask(asks.command("takeoff", session="bert", id="r1"))
    bench.clock.advance(10)
    again = bench.ask(asks.command("takeoff", session="bert", id="r1"))
    await asks.settle()
    assert statuses(again) == [REJECTED]
    assert ("takeoff", None) not in bench.adapter.calls


async def test_a_release_that_is_delivered_again_does_not_release_the_next_stop(bench, asks):
    bench.controller.emergency("one")
    bench.ask(asks.command("release_emergency_stop", id="r1"))
    bench.controller.emergency("two")
    bench.ask(asks.command("release_emergency_stop", id="r1"))
    assert bench.controller.latched


async def test_a_resume_that_is_delivered_again_does_not_go_on_after_the_next_pause(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    for _ in range(2):
        bench.ask(control(asks, Control.PAUSE))
        await asks.settle()
        bench.ask(control(asks, Control.RESUME, "r1"))
        await asks.settle()
    assert len([call for call in bench.adapter.calls if hasattr(call, "goal")]) == 2


async def test_a_goal_that_was_refused_does_not_begin_when_it_is_delivered_again(bench, asks):
    bench.controller.lost("no heartbeat")
    bench.ask(asks.goal("a1"))
    bench.controller.found()
    answers = bench.ask(asks.goal("a1"))
    await asks.settle()
    assert statuses(answers) == [REJECTED]
    assert bench.statuses() == ["failed", "failed"]


async def test_a_resume_that_is_refused_says_nothing_of_the_action_it_names(bench, asks):
    bench.ask(asks.goal("a1"))
    await asks.settle()
    bench.ask(control(asks, Control.RESUME, "a1"))
    assert bench.statuses() == ["queued", "running"]


async def test_a_stop_is_completed_when_the_robot_stands_and_not_before(bench, asks):
    bench.ask(control(asks, Control.STOP, "s1"))
    assert bench.statuses() == []
    await asks.settle()
    assert bench.statuses() == ["completed"]


async def test_the_adapter_is_restarted_by_who_may_command_it(bench, asks):
    bench.ask(asks.command("restart_adapter", source="sim"))
    assert bench.restarts == []
    bench.ask(asks.command("restart_adapter"))
    assert bench.restarts == [1]


async def test_what_is_asked_after_a_failure_waits_until_the_robot_stands(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.adapter.calls.clear()
    bench.ask(asks.command("shy"))
    await asks.settle()
    bench.ask(asks.command("takeoff"))
    await asks.settle()
    assert bench.adapter.calls.index("stop") < bench.adapter.calls.index(("takeoff", None))
    assert bench.adapter.calls[-1] == ("takeoff", None)


async def test_a_robot_with_a_fault_is_not_moved_and_says_why(bench, asks):
    bench.controller.faulted("the left arm is hot; send cool_down")
    refused = bench.ask(asks.setpoint()) + bench.ask(asks.command("takeoff")) + bench.ask(asks.goal())
    assert [answer.reason for answer in refused] == [
        "it has a fault: the left arm is hot; send cool_down"
    ] * 3
    assert bench.adapter.calls == []


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "land", "battery_check"])
async def test_a_robot_with_a_fault_is_stopped_and_asked_what_does_not_move_it(bench, asks, name):
    bench.controller.faulted("the left arm is hot")
    answers = bench.ask(asks.command(name))
    await asks.settle()
    assert statuses(answers) == [ACCEPTED]
    assert bench.adapter.calls


@pytest.mark.parametrize("given", ["setpoint", "goal"])
async def test_a_fault_halts_what_is_under_way(bench, asks, given):
    bench.ask(getattr(asks, given)())
    await asks.settle()
    bench.controller.faulted("the left arm is hot")
    await asks.settle()
    assert "halt" in bench.adapter.calls
    assert not bench.controller.in_motion


async def test_a_command_that_a_fault_ends_gets_the_fault_as_its_reason(bench, asks):
    answers = bench.ask(asks.command("takeoff"), waits=True)
    await asks.settle()
    bench.controller.faulted("the left arm is hot")
    assert (answers[-1].done, answers[-1].reason) == (False, "the left arm is hot")


async def test_a_fault_does_not_break_off_a_landing(bench, asks):
    bench.adapter.go.clear()
    bench.controller.faulted("first")
    bench.controller.found()
    bench.ask(asks.command("land"))
    bench.controller.faulted("the left arm is hot")
    await asks.settle()
    assert bench.adapter.calls == ["land"]


async def test_a_fault_that_is_gone_lets_the_robot_move_again(bench, asks):
    bench.controller.faulted("the left arm is hot")
    bench.controller.found()
    assert statuses(bench.ask(asks.setpoint())) == [ACCEPTED]


async def test_an_emergency_stop_has_a_halt_of_its_own(bench, asks):
    bench.adapter.emergency_halt = lambda: bench.adapter.calls.append("emergency halt")
    bench.controller.emergency("test")
    bench.controller.halt()
    assert bench.adapter.calls == ["emergency halt", "halt"]


@pytest.mark.parametrize("given", ["goal", "setpoint", "takeoff"])
@pytest.mark.parametrize("back", ["found", "faulted"])
async def test_a_robot_that_was_lost_while_it_moved_is_stopped_when_it_is_back(bench, asks, given, back):
    bench.ask(asks.command(given) if given == "takeoff" else getattr(asks, given)())
    await asks.settle()
    bench.controller.lost("no heartbeat")
    before = len(bench.adapter.calls)
    getattr(bench.controller, back)(*["a leg is hot"] * (back == "faulted"))
    bench.controller.found()
    await asks.settle()
    assert [call for call in bench.adapter.calls[before:] if call != "halt"] == ["stop"]


async def test_it_is_stopped_by_the_next_run_too(bench, asks):
    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.detach("the port is gone")
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls[-2:] == ["halt", "stop"]


async def test_a_stop_that_the_loss_broke_off_is_begun_anew(bench, asks):
    bench.ask(asks.goal())
    bench.adapter.stops = "never"
    bench.ask(asks.command("stop"))
    await asks.settle()
    bench.controller.lost("no heartbeat")
    bench.adapter.stops = ""
    bench.adapter.go.set()
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls.count("stop") == 2


@pytest.mark.parametrize("stops", [LinkLost("gone"), NotReady("busy"), "never"])
@pytest.mark.parametrize("ended_by", ["a stop", "its own failure"])
async def test_a_robot_whose_stop_was_not_seen_before_it_was_lost_is_stopped_when_it_is_back(
    bench, asks, ended_by, stops
):
    bench.adapter.stops = stops
    bench.adapter.raises = LinkLost("gone") if ended_by == "its own failure" else None
    bench.ask(asks.goal())
    await asks.settle()
    if ended_by == "a stop":
        bench.ask(asks.command("stop"))
        await asks.settle()
    assert not bench.controller.in_motion
    bench.controller.lost("no heartbeat")
    before = len(bench.adapter.calls)
    bench.adapter.stops, bench.adapter.raises = "", None
    bench.adapter.go.set()
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls[before:] == ["stop"]


async def test_a_robot_that_did_what_was_asked_after_a_stop_failed_is_left_alone_when_it_is_back(bench, asks):
    bench.adapter.stops = NotReady("busy")
    bench.ask(asks.command("stop"))
    await asks.settle()
    bench.adapter.go.set()
    bench.ask(asks.goal())
    await asks.settle()
    before = len(bench.adapter.calls)
    bench.controller.lost("no heartbeat")
    bench.controller.found()
    await asks.settle()
    assert "stop" not in bench.adapter.calls[before:]


async def test_one_that_is_lost_again_before_it_was_seen_to_stand_is_stopped_once_more(make_bench, asks):
    bench = make_bench()
    bench.ask(asks.goal())
    await asks.settle()
    bench.controller.detach("the port is gone")
    bench.adapter.stops = "never"
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await asks.settle()
    bench.controller.detach("it is gone again")
    bench.adapter.stops = ""
    bench.adapter.go.set()
    bench.controller.attach(bench.adapter)
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls.count("stop") == 2


@pytest.mark.parametrize(("since", "stopped"), [(3.0, ["stop"]), (60.0, [])])
async def test_one_that_may_not_have_heard_the_end_of_its_velocity_is_stopped_when_it_is_back(
    bench, asks, since, stopped
):
    bench.ask(asks.setpoint())
    bench.clock.advance(0.6)
    assert bench.controller.deadman.expire(bench.clock.monotonic())
    bench.controller.halt()
    bench.controller.motion.lease_ran_out()
    bench.clock.advance(since)
    bench.controller.lost("silent")
    before = len(bench.adapter.calls)
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls[before:] == stopped


@pytest.mark.parametrize("ended_by", ["a zero", "a late zero", "a fault"])
async def test_one_whose_goal_ended_without_a_stop_before_it_was_lost_is_stopped_when_it_is_back(
    bench, asks, ended_by
):
    bench.ask(asks.goal())
    await asks.settle()
    if ended_by == "a fault":
        bench.controller.faulted("a leg is hot")
    else:
        bench.ask(asks.setpoint(0.0, stamp=None if ended_by == "a zero" else 0.0))
    bench.clock.advance(3.0)
    bench.controller.lost("silent")
    before = len(bench.adapter.calls)
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls[before:] == ["stop"]


async def test_one_that_was_seen_to_stand_since_its_last_velocity_is_left_alone_when_it_is_back(bench, asks):
    bench.ask(asks.setpoint())
    bench.ask(asks.command("stop"))
    await asks.settle()
    bench.controller.lost("silent")
    bench.controller.found()
    await asks.settle()
    assert bench.adapter.calls.count("stop") == 1


@pytest.mark.parametrize("meanwhile", ["nothing", "land", "pilot"])
async def test_one_that_stood_or_landed_or_has_a_pilot_is_left_alone_when_it_is_back(bench, asks, meanwhile):
    bench.adapter.land = bench.adapter.go.wait  # it takes its time
    bench.ask(asks.command("land" if meanwhile == "land" else "takeoff"))
    await asks.settle()
    if meanwhile == "nothing":
        bench.adapter.go.set()
        await asks.settle()
    bench.controller.lost("no heartbeat")
    if meanwhile == "pilot":
        bench.controller.authority_lost("the pilot switched to POSHOLD")
    bench.controller.found()
    await asks.settle()
    assert "stop" not in bench.adapter.calls


async def test_what_an_earlier_process_left_moving_is_stopped(make_bench, asks):
    journal = RobotJournal(past=[PastCommand("a1", "navigate", action=True, outcome="")])
    bench = make_bench(journal=journal)
    await asks.settle()
    assert bench.adapter.calls == ["stop"]


@pytest.mark.parametrize("how", ["stop", "control"])
@pytest.mark.parametrize("late", ["setpoint", "goal", "takeoff"])
async def test_what_was_asked_before_a_stop_and_arrives_after_it_is_refused(bench, asks, how, late):
    now = bench.clock.time()

    async def asked(kind, action, stamp, session="anna"):
        make = {
            "setpoint": lambda: asks.setpoint(stamp=stamp, session=session),
            "goal": lambda: asks.goal(action, stamp=stamp, session=session),
            "takeoff": lambda: asks.command("takeoff", stamp=stamp, session=session),
        }
        answers = bench.ask(make[kind]())
        await asks.settle()
        return answers[0]

    await asked("setpoint", "", now - 0.4)
    stop = asks.command("stop", stamp=now - 0.2)
    bench.ask(stop if how == "stop" else Navigate(Control.STOP, "", stop.origin, now - 0.2))
    await asks.settle()
    refused = await asked(late, "a1", now - 0.3)
    assert refused.reason == "sent before a stop that arrived first"
    others = await asked(late, "a2", now - 0.1, session="bert")  # whose clock is another
    assert others.reason.startswith("sent before another sender's stop, or too soon after it")
    assert (await asked(late, "a3", now - 0.1)).ok, "who stopped knows what came after it"


@pytest.mark.parametrize("who", ["anna", "bert", ""])
@pytest.mark.parametrize("late", ["setpoint", "goal", "takeoff", "release"])
async def test_nothing_from_before_a_stop_that_is_the_first_thing_heard_moves_the_robot(
    bench, asks, late, who
):
    now = bench.clock.time()
    bench.ask(asks.command("emergency_stop" if late == "release" else "stop", stamp=now - 0.05))
    await asks.settle()
    make = {
        "setpoint": asks.setpoint(stamp=now - 0.1, session=who),
        "goal": asks.goal("a1", stamp=now - 0.1, session=who),
        "takeoff": asks.command("takeoff", stamp=now - 0.1, session=who),
        "release": asks.command("release_emergency_stop", stamp=now - 0.1, session=who),
    }
    before = list(bench.adapter.calls)
    (answer, *_) = bench.ask(make[late])
    await asks.settle()
    assert statuses([answer]) == [REJECTED]
    assert "stop" in answer.reason
    assert bench.adapter.calls == before
    bench.clock.advance(1.0)
    assert bench.ask(asks.command("release_emergency_stop", stamp=now + 1.0, session=who))[0].ok
    assert bench.ask(asks.setpoint(stamp=now + 1.0, session=who))[0].ok


async def test_those_without_a_session_are_distinguished_by_their_stamps_but_for_velocities(bench, asks):
    now = bench.clock.time()
    bench.ask(asks.command("emergency_stop", stamp=now, session=""))
    await asks.settle()
    assert not bench.ask(asks.command("release_emergency_stop", stamp=now - 0.01, session=""))[0].ok
    assert bench.ask(asks.command("release_emergency_stop", stamp=now + 0.01, session=""))[0].ok
    assert not bench.ask(asks.setpoint(stamp=now + 0.01, session=""))[0].ok
    bench.clock.advance(0.4)
    assert bench.ask(asks.setpoint(stamp=now + 0.4, session=""))[0].ok


async def test_what_only_makes_it_safer_is_let_through_right_after_somebody_s_stop(bench, asks):
    now = bench.clock.time()
    bench.ask(asks.command("stop", stamp=now))
    await asks.settle()
    for name in ("land", "battery_check"):
        answers = bench.ask(asks.command(name, stamp=now + 0.01, session="bert"))
        await asks.settle()
        assert answers[0].ok


async def test_a_stream_that_is_always_late_moves_nothing_and_its_delay_is_reported(bench, asks):
    answers = []
    for _ in range(50):
        answers += bench.ask(asks.setpoint(stamp=bench.clock.time() - 1.9))
        bench.clock.advance(0.1)
    assert {answer.ok for answer in answers} == {False}
    assert "1.90 s late; clock_skew is 0.3 s" in answers[-1].reason
    assert bench.controller.senders() == {"cloud/anna": 1.9}


async def test_a_stop_of_a_robot_that_is_lost_meanwhile_is_not_reported_as_done(bench, asks):
    bench.adapter.stops = "never"
    answers = bench.ask(asks.command("stop"), waits=True)
    await asks.settle()
    bench.controller.lost("no heartbeat")
    bench.adapter.go.set()
    await asks.settle()
    assert statuses(answers) == [REJECTED]
    assert "no heartbeat" in answers[0].reason


# -- a velocity that is set ---------------------------------------------------------------------------


def a_setting(asks, value=0.2, session="anna"):
    """Return the message that sets how fast later verbs are."""
    return asks.command("set_linear_velocity", session=session, data={"linear": value})


async def test_a_velocity_that_is_set_moves_nothing_and_its_answer_has_the_applied_value(bench, asks):
    answers = bench.ask(a_setting(asks, 99.0), waits=True)
    await asks.settle()
    assert bench.adapter.calls == []
    assert not bench.controller.in_motion
    assert [(answer.status, answer.data) for answer in answers] == [(ACCEPTED, {"linear": 2.0})]
    assert bench.controller.speeds.of("anna").forward == 2.0


@pytest.mark.parametrize(
    "end",
    [
        lambda bench, asks: bench.ask(asks.command("stop", session="bert")),
        lambda bench, asks: bench.ask(asks.command("emergency_stop")),
        lambda bench, asks: bench.ask(Navigate(Control.STOP, "", asks.goal().origin)),
        lambda bench, asks: bench.controller.authority_lost("the pilot switched to POSHOLD"),
        lambda bench, asks: bench.controller.detach("it begins anew"),
        lambda bench, asks: bench.clock.advance(10.0) or bench.ask(asks.setpoint(session="bert")),
    ],
    ids=["stop", "emergency stop", "stop of navigation", "takeover", "restart", "another driver"],
)
async def test_a_velocity_that_is_set_ends_with(bench, asks, end):
    bench.ask(a_setting(asks))
    assert bench.controller.speeds.of("anna").forward == 0.2
    end(bench, asks)
    await asks.settle()
    assert bench.controller.speeds.of("anna").forward == 0.5


async def test_a_velocity_cannot_be_set_by_who_may_not_move_the_robot(bench, asks):
    bench.ask(asks.setpoint())
    assert "has control" in bench.ask(a_setting(asks, session="bert"))[0].reason
    bench.ask(asks.command("emergency_stop"))
    await asks.settle()
    assert "emergency stop is set" in bench.ask(a_setting(asks))[0].reason
    assert bench.controller.speeds.of("anna").forward == 0.5


def refusing(error):
    """Return a ``halt_unheard`` that raises."""

    def halt_unheard(reason):
        raise error

    return halt_unheard


@pytest.mark.parametrize(
    ("halt_unheard", "expected"),
    [
        (lambda _: True, "the stop was written, but the robot does not answer"),
        (lambda _: False, "the stop was given to its adapter, which does not know whether it was written"),
        (refusing(LinkLost("the cable is out")), "the stop was not written: the cable is out"),
        (refusing(NotReady("a pilot has it")), "the stop was not written: a pilot has it"),
        (refusing(KeyError("x")), "the stop may not have been written: its adapter failed"),
    ],
    ids=["written", "unknown", "lost", "refused", "crashed"],
)
async def test_a_stop_of_a_robot_that_is_not_heard_says_no_more_than_is_true(
    bench, asks, monkeypatch, halt_unheard, expected
):
    monkeypatch.setattr(bench.adapter, "halt_unheard", halt_unheard)
    bench.controller.lost("silent")
    answers = [answer for name in STOP_WORDS for answer in bench.ask(asks.command(name))]
    assert {(answer.ok, answer.reason.partition("; ")[2]) for answer in answers} == {(False, expected)}
    bench.controller.detach("the device is gone")
    (answer,) = bench.ask(asks.command("stop"))
    assert answer.reason.endswith("the stop was not written: no link to it is open")


@pytest.mark.parametrize(
    ("released", "expected"), [(False, ["emergency_stop"]), (True, [])], ids=["set", "released"]
)
async def test_an_emergency_stop_of_a_robot_that_is_not_heard_is_repeated_once_when_it_is_back(
    bench, asks, monkeypatch, released, expected
):
    reasons = []

    async def stop(reason):
        reasons.append(reason)

    monkeypatch.setattr(bench.adapter, "stop", stop)
    bench.controller.lost("silent")
    bench.ask(asks.command("emergency_stop"))
    if released:
        bench.ask(asks.command("release_emergency_stop"))
    for _ in range(2):
        bench.controller.found()
        await asks.settle()
        bench.controller.lost("silent")
    assert reasons == expected


async def test_a_stop_that_a_blocked_link_has_not_taken_is_not_called_written(make_bench, asks, monkeypatch):
    bench, free = make_bench(), threading.Event()
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 0.01)
    monkeypatch.setattr(bench.adapter, "halt_unheard", lambda _: free.wait(20.0))
    bench.controller.lost("silent")
    (answer,) = bench.ask(asks.command("stop"))
    free.set()
    assert answer.reason.endswith("the stop may not have been written: its link has not taken it yet")


async def test_a_robot_in_a_run_obeys_nobody_elses_motion(bench, asks):
    bench.ask(asks.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    refused = bench.ask(asks.command("takeoff", session="anna")) + bench.ask(asks.setpoint(session="anna"))
    refused += bench.ask(asks.goal("a1", session="anna"))
    await asks.settle()
    assert bench.adapter.calls == []
    assert {answer.reason for answer in refused} == {"it is in run 3f2a; fleet take takes it out of the run"}
    bench.ask(asks.command("takeoff", session="run 3f2a"))
    await asks.settle()
    assert bench.adapter.calls == [("takeoff", None)]


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "land", "take"])
async def test_what_takes_a_robot_out_of_its_run_keeps_the_run_from_it(bench, asks, name):
    bench.ask(asks.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.ask(asks.command(name, session="anna"))
    await asks.settle()
    assert bench.controller.lease.run == ""
    assert "anna" in bench.controller.lease.left
    bench.adapter.calls.clear()
    late = bench.ask(asks.command("takeoff", session="run 3f2a"))
    late += bench.ask(asks.command("land", session="run 3f2a"))
    await asks.settle()
    assert bench.adapter.calls == []
    assert statuses(late) == [REJECTED, REJECTED]


async def test_a_run_that_stops_its_own_robot_keeps_it(bench, asks):
    bench.ask(asks.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.ask(asks.command("stop", session="run 3f2a"))
    await asks.settle()
    assert bench.controller.lease.run == "3f2a"
    bench.ask(asks.command("leave_run", data={"run": "other"}, session="run other"))
    assert bench.controller.lease.run == "3f2a"
    bench.ask(asks.command("leave_run", data={"run": "3f2a"}, session="run 3f2a"))
    assert bench.controller.lease.run == ""


async def test_a_robot_that_somebody_drives_joins_no_run(bench, asks):
    bench.ask(asks.setpoint(session="anna"))
    (answer,) = bench.ask(asks.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    assert "anna has control" in answer.reason


async def test_a_pilot_takes_a_robot_out_of_its_run(bench, asks):
    bench.ask(asks.command("join_run", data={"run": "3f2a"}, session="run 3f2a"))
    bench.controller.authority_lost("pilot")
    assert bench.controller.lease.left == "taken: authority lost: pilot"
