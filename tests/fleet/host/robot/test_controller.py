import logging

import msgspec
import pytest

from fleet.errors import NotReady
from fleet.model.command import ReplyStatus
from fleet.model.navigation import Control, Navigate

ACCEPTED, REJECTED, DENIED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED, ReplyStatus.DENIED


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for an emergency halt to be written, on however busy a machine."""
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)


def statuses(answers):
    return [answer.status for answer in answers]


async def test_a_command_reaches_the_robot_and_is_answered_once(bench, requests):
    answers = bench.request(requests.command("land"))
    await requests.settle()
    assert bench.adapter.calls == ["land"]
    assert statuses(answers) == [ACCEPTED]


async def test_who_waits_also_hears_that_it_is_done(bench, requests):
    answers = bench.request(requests.command("takeoff", data={"altitude": 3}), waits=True)
    await requests.settle()
    assert [answer.done for answer in answers] == [None]
    bench.adapter.go.set()
    await requests.settle()
    assert [answer.done for answer in answers] == [None, True]


@pytest.mark.parametrize("source", [None, "edge", "sim", "sim_tele", "edit", "nonsense"])
async def test_a_command_from_a_wrong_source_never_reaches_the_robot(bench, requests, source):
    answers = bench.request(requests.command("land", source=source)) + bench.request(
        requests.setpoint(source=source)
    )
    await requests.settle()
    assert bench.adapter.calls == []
    assert statuses(answers) == [REJECTED, REJECTED]


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "hover"])
async def test_a_stop_is_obeyed_from_anyone_however_old(bench, requests, name):
    answers = bench.request(requests.command(name, source=None, stamp=1.0))
    await requests.settle()
    assert "stop" in bench.adapter.calls
    assert statuses(answers) == [ACCEPTED]


async def test_an_undeclared_command_is_refused_with_the_nearest(bench, requests):
    (answer,) = bench.request(requests.command("take_off"))
    assert answer.status is REJECTED
    assert "takeoff" in answer.hint


async def test_what_this_robot_lacks_is_refused_with_the_reason_and_its_drive_goes_on(bench, requests):
    lacking = {"takeoff": "it has wheels", "move_backward": "it has no reverse", "goto": "it knows no place"}
    bench.controller.can = msgspec.structs.replace(bench.controller.can, lacking=lacking)
    bench.request(requests.setpoint(1.0))
    (takeoff,) = bench.request(requests.command("takeoff"))
    (back,) = bench.request(requests.setpoint(-1.0))
    answers = bench.request(requests.goal())
    await requests.settle()
    assert (takeoff.status, takeoff.hint) == (REJECTED, "it has wheels")
    assert (back.status, back.reason) == (REJECTED, "it has no reverse")
    assert "it knows no place" in answers[0].reason
    assert [each.linear.x for each in bench.adapter.calls] == [1.0]
    assert bench.controller.in_motion


async def test_a_wrong_argument_is_refused_by_name(bench, requests):
    answers = bench.request(requests.command("takeoff", data={"altitud": 3}))
    await requests.settle()
    assert "altitude" in answers[0].hint
    assert bench.adapter.calls == []


async def test_the_robots_own_words_come_back(bench, requests):
    answers = bench.request(requests.command("shy"))
    await requests.settle()
    assert (answers[0].status, answers[0].reason) == (DENIED, "not today")
    assert answers[0].messages == ("Arm: no GPS",)


async def test_a_repeated_command_is_done_once_and_answered_alike(bench, requests):
    first = bench.request(requests.command("land", id="r1"))
    await requests.settle()
    second = bench.request(requests.command("land", id="r1"))
    await requests.settle()
    assert bench.adapter.calls == ["land"]
    assert first == second


async def test_a_second_operator_waits_for_the_control_lease(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    assert statuses(bench.request(requests.setpoint(session="bert"))) == [REJECTED]
    bench.clock.advance(3.1)
    assert statuses(bench.request(requests.setpoint(session="bert"))) == [ACCEPTED]


async def test_an_operator_who_stops_lets_go_of_the_robot(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    bench.request(requests.command("stop", session="bert"))
    assert statuses(bench.request(requests.setpoint(session="bert"))) == [REJECTED]
    bench.request(requests.command("stop", session="anna"))
    assert statuses(bench.request(requests.setpoint(session="bert"))) == [ACCEPTED]


async def test_a_stick_that_is_held_does_not_undo_somebody_else_s_stop(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    bench.request(requests.command("stop", session="bert"))
    for _ in range(20):
        bench.clock.advance(0.1)
        (answer,) = bench.request(requests.setpoint(session="anna"))
        assert "another sender stopped it" in answer.reason
    assert not bench.controller.in_motion
    bench.clock.advance(0.6)
    assert statuses(bench.request(requests.setpoint(session="anna"))) == [ACCEPTED]


async def test_an_emergency_stop_is_latched_until_it_is_released(bench, requests):
    bench.request(requests.command("emergency_stop", source=None))
    await requests.settle()
    assert bench.adapter.calls[0] == "halt"
    refused = (
        bench.request(requests.setpoint())
        + bench.request(requests.command("takeoff"))
        + bench.request(requests.goal())
    )
    assert statuses(refused) == [REJECTED] * 3
    bench.request(requests.command("release_emergency_stop"))
    assert statuses(bench.request(requests.setpoint())) == [ACCEPTED]


async def test_an_emergency_stop_is_reported_only_once_the_orderly_stop_is_under_way(bench, requests):
    """A log or a bus that is held up there would keep everything before it waiting."""
    seen = []

    class Slow(logging.Handler):
        def emit(self, record):
            if record.levelno == logging.CRITICAL:
                seen.append((bench.controller.in_motion, bench.controller.motion.executor.stopping))

    bench.request(requests.goal())
    await requests.settle()
    bench.controller.event_reporter.log.addHandler(slow := Slow())
    try:
        bench.request(requests.command("emergency_stop"))
    finally:
        bench.controller.event_reporter.log.removeHandler(slow)
    assert seen == [(False, True)]


async def test_landing_is_allowed_while_an_emergency_stop_is_latched(bench, requests):
    bench.controller.emergency("test")
    answers = bench.request(requests.command("land"))
    await requests.settle()
    assert statuses(answers) == [ACCEPTED]


async def test_a_newer_moving_command_takes_the_place_of_the_older(bench, requests):
    older = bench.request(requests.command("takeoff"), waits=True)
    await requests.settle()
    bench.request(requests.command("land"))
    await requests.settle()
    assert older[-1].done is False
    assert older[-1].reason == "superseded by land"


@pytest.mark.parametrize("doing", ["takeoff", "goto", "driving"])
async def test_arming_takes_the_place_of_nothing_that_moves(bench, requests, doing):
    request = {
        "takeoff": requests.command("takeoff"),
        "goto": requests.goal(),
        "driving": requests.setpoint(),
    }[doing]
    older = bench.request(request, waits=True)
    await requests.settle()
    (answer,) = bench.request(requests.command("arm"))
    await requests.settle()
    assert (answer.status, answer.reason.partition(" ")[0]) == (REJECTED, "busy")
    assert older[-1].done is not False
    assert bench.controller.in_motion


async def test_arming_a_robot_that_does_nothing_is_carried_out(bench, requests):
    answers = bench.request(requests.command("arm"))
    await requests.settle()
    assert statuses(answers) == [ACCEPTED]


async def test_a_stop_ends_a_takeoff(bench, requests):
    older = bench.request(requests.command("takeoff"), waits=True)
    await requests.settle()
    bench.request(requests.command("stop"))
    await requests.settle()
    assert older[-1].done is False
    assert bench.adapter.calls[-1] == "stop"


async def test_an_offline_robot_is_asked_nothing_but_is_still_halted(bench, requests):
    bench.controller.lost("no heartbeat")
    bench.adapter.calls.clear()
    answers = (
        bench.request(requests.command("land"))
        + bench.request(requests.setpoint())
        + bench.request(requests.command("stop"))
    )
    await requests.settle()
    assert statuses(answers) == [REJECTED] * 3
    assert all("no heartbeat" in answer.reason for answer in answers)
    assert bench.adapter.calls == ["halt"]


@pytest.mark.parametrize("kind", ["command", "setpoint", "goal"])
async def test_an_adapter_that_raises_anything_is_reported_to_the_runner(bench, requests, kind):
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.request(requests.command("takeoff") if kind == "command" else getattr(requests, kind)())
    await requests.settle()
    assert [type(crash) for crash in bench.crashes] == [ZeroDivisionError]


async def test_authority_lost_ends_everything_and_is_reported(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.controller.authority_lost("the pilot switched to POSHOLD")
    assert len(bench.telemetry_of("authority_lost")) == 1
    assert bench.statuses()[-1] == "failed"
    assert not bench.controller.motion.in_control


# -- what must not leave the robot moving ----------------------------------------------------------------


async def test_a_command_that_is_refused_after_it_ended_an_action_holds_the_robot(bench, requests, caplog):
    bench.request(requests.goal())
    await requests.settle()
    bench.request(requests.command("shy"))
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert "shy failed: not today: it is brought to a standstill" in caplog.text


async def test_a_command_with_data_that_it_does_not_take_breaks_nothing_off(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    before = list(bench.adapter.calls)
    (answer,) = bench.request(requests.command("takeoff", data={"no_such": 1}))
    await requests.settle()
    assert answer.status is DENIED
    assert bench.adapter.calls == before


async def test_a_command_that_is_refused_at_rest_does_not_move_the_robot_at_all(bench, requests):
    bench.request(requests.command("shy"))
    await requests.settle()
    assert bench.adapter.calls == []


async def test_a_command_that_the_robot_took_and_then_failed_ends_in_a_stop(bench, requests):
    bench.request(requests.command("takeoff"))
    await requests.settle()
    bench.adapter.raises = NotReady("a motor is weak")
    bench.adapter.go.set()
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"


# -- repeats ---------------------------------------------------------------------------------------------


async def test_a_repeat_of_what_is_still_under_way_gets_the_same_answers(bench, requests):
    first = bench.request(requests.command("takeoff", id="r1"), waits=True)
    again = bench.request(requests.command("takeoff", id="r1"), waits=True)
    await requests.settle()
    bench.adapter.go.set()
    await requests.settle()
    assert [answer.done for answer in again] == [None, True]
    assert first == again


async def test_a_command_that_was_refused_is_not_done_when_it_is_delivered_again(bench, requests):
    bench.request(requests.setpoint(session="anna"))
    bench.request(requests.command("takeoff", session="bert", id="r1"))
    bench.clock.advance(10)
    again = bench.request(requests.command("takeoff", session="bert", id="r1"))
    await requests.settle()
    assert statuses(again) == [REJECTED]
    assert ("takeoff", None) not in bench.adapter.calls


async def test_a_robot_with_a_fault_is_not_moved_and_says_why(bench, requests):
    bench.controller.faulted("the left arm is hot; send cool_down")
    refused = (
        bench.request(requests.setpoint())
        + bench.request(requests.command("takeoff"))
        + bench.request(requests.goal())
    )
    assert [answer.reason for answer in refused] == [
        "it has a fault: the left arm is hot; send cool_down"
    ] * 3
    assert bench.adapter.calls == []


@pytest.mark.parametrize("name", ["stop", "emergency_stop", "land", "battery_check"])
async def test_a_robot_with_a_fault_is_stopped_and_asked_what_does_not_move_it(bench, requests, name):
    bench.controller.faulted("the left arm is hot")
    answers = bench.request(requests.command(name))
    await requests.settle()
    assert statuses(answers) == [ACCEPTED]
    assert bench.adapter.calls


@pytest.mark.parametrize("given", ["setpoint", "goal"])
async def test_a_fault_halts_what_is_under_way(bench, requests, given):
    bench.request(getattr(requests, given)())
    await requests.settle()
    bench.controller.faulted("the left arm is hot")
    await requests.settle()
    assert "halt" in bench.adapter.calls
    assert not bench.controller.in_motion


async def test_a_command_that_a_fault_ends_gets_the_fault_as_its_reason(bench, requests):
    answers = bench.request(requests.command("takeoff"), waits=True)
    await requests.settle()
    bench.controller.faulted("the left arm is hot")
    assert (answers[-1].done, answers[-1].reason) == (False, "the left arm is hot")


async def test_a_fault_does_not_break_off_a_landing(bench, requests):
    bench.adapter.go.clear()
    bench.controller.faulted("first")
    bench.controller.found()
    bench.request(requests.command("land"))
    bench.controller.faulted("the left arm is hot")
    await requests.settle()
    assert bench.adapter.calls == ["land"]


async def test_a_fault_that_is_gone_lets_the_robot_move_again(bench, requests):
    bench.controller.faulted("the left arm is hot")
    bench.controller.found()
    assert statuses(bench.request(requests.setpoint())) == [ACCEPTED]


async def test_an_emergency_stop_has_a_halt_of_its_own(bench, requests):
    bench.adapter.emergency_halt = lambda: bench.adapter.calls.append("emergency halt")
    bench.controller.emergency("test")
    bench.controller.halt()
    assert bench.adapter.calls == ["emergency halt", "halt"]


@pytest.mark.parametrize("how", ["stop", "control"])
@pytest.mark.parametrize("late", ["setpoint", "goal", "takeoff"])
async def test_what_was_asked_before_a_stop_and_arrives_after_it_is_refused(bench, requests, how, late):
    now = bench.clock.time()

    async def requested(kind, action, stamp, session="anna"):
        make = {
            "setpoint": lambda: requests.setpoint(stamp=stamp, session=session),
            "goal": lambda: requests.goal(action, stamp=stamp, session=session),
            "takeoff": lambda: requests.command("takeoff", stamp=stamp, session=session),
        }
        answers = bench.request(make[kind]())
        await requests.settle()
        return answers[0]

    await requested("setpoint", "", now - 0.4)
    stop = requests.command("stop", stamp=now - 0.2)
    bench.request(stop if how == "stop" else Navigate(Control.STOP, "", stop.origin, now - 0.2))
    await requests.settle()
    refused = await requested(late, "a1", now - 0.3)
    assert refused.reason == "sent before a stop that arrived first"
    others = await requested(late, "a2", now - 0.1, session="bert")  # whose clock is another
    assert others.reason.startswith("sent before another sender's stop, or too soon after it")
    assert (await requested(late, "a3", now - 0.1)).ok, "who stopped knows what came after it"


@pytest.mark.parametrize("who", ["anna", "bert", ""])
@pytest.mark.parametrize("late", ["setpoint", "goal", "takeoff", "release"])
async def test_nothing_from_before_a_stop_that_is_the_first_thing_heard_moves_the_robot(
    bench, requests, late, who
):
    now = bench.clock.time()
    bench.request(requests.command("emergency_stop" if late == "release" else "stop", stamp=now - 0.05))
    await requests.settle()
    make = {
        "setpoint": requests.setpoint(stamp=now - 0.1, session=who),
        "goal": requests.goal("a1", stamp=now - 0.1, session=who),
        "takeoff": requests.command("takeoff", stamp=now - 0.1, session=who),
        "release": requests.command("release_emergency_stop", stamp=now - 0.1, session=who),
    }
    before = list(bench.adapter.calls)
    (answer, *_) = bench.request(make[late])
    await requests.settle()
    assert statuses([answer]) == [REJECTED]
    assert "stop" in answer.reason
    assert bench.adapter.calls == before
    bench.clock.advance(1.0)
    assert bench.request(requests.command("release_emergency_stop", stamp=now + 1.0, session=who))[0].ok
    assert bench.request(requests.setpoint(stamp=now + 1.0, session=who))[0].ok


async def test_those_without_a_session_are_distinguished_by_their_stamps_but_for_velocities(bench, requests):
    now = bench.clock.time()
    bench.request(requests.command("emergency_stop", stamp=now, session=""))
    await requests.settle()
    assert not bench.request(requests.command("release_emergency_stop", stamp=now - 0.01, session=""))[0].ok
    assert bench.request(requests.command("release_emergency_stop", stamp=now + 0.01, session=""))[0].ok
    assert not bench.request(requests.setpoint(stamp=now + 0.01, session=""))[0].ok
    bench.clock.advance(0.4)
    assert bench.request(requests.setpoint(stamp=now + 0.4, session=""))[0].ok


async def test_what_only_makes_it_safer_is_let_through_right_after_somebody_s_stop(bench, requests):
    now = bench.clock.time()
    bench.request(requests.command("stop", stamp=now))
    await requests.settle()
    for name in ("land", "battery_check"):
        answers = bench.request(requests.command(name, stamp=now + 0.01, session="bert"))
        await requests.settle()
        assert answers[0].ok


@pytest.mark.parametrize(
    ("released", "expected"), [(False, ["emergency_stop"]), (True, [])], ids=["set", "released"]
)
async def test_an_emergency_stop_of_a_robot_that_is_not_heard_is_repeated_once_when_it_is_back(
    bench, requests, monkeypatch, released, expected
):
    reasons = []

    async def stop(reason):
        reasons.append(reason)

    monkeypatch.setattr(bench.adapter, "stop", stop)
    bench.controller.lost("silent")
    bench.request(requests.command("emergency_stop"))
    if released:
        bench.request(requests.command("release_emergency_stop"))
    for _ in range(2):
        bench.controller.found()
        await requests.settle()
        bench.controller.lost("silent")
    assert reasons == expected
