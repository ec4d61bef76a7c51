"""Asking, and what comes back or does not."""

import asyncio

import pytest

from fleet import GeoPoint, NotReady, Refused, TimedOut, Unsupported
from fleet_mavlink.commander import NEVER_SENT, Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.messages import CommandAck, CommandInt, CommandLong, StatusTextMessage
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState

ARM = CommandLong(MavCmd.COMPONENT_ARM_DISARM, param1=1.0)
LOITER, LAND, OFFBOARD = 0x03040000, 0x06040000, 0x00060000
MODE = Px4().mode_of


class Talk:
    """A commander in a loop whose time jumps; ``later`` lets the vehicle say something after a while."""

    def __init__(self, harness):
        loop = asyncio.get_running_loop()
        self.harness = harness()
        self.harness.clock.monotonic = self.harness.vehicle.now = loop.time
        self.commander = Commander(self.harness.vehicle, CommandTimeouts())
        self.loop = loop
        self.harness.beat()

    @property
    def sent(self):
        return self.harness.sent

    def later(self, seconds, *messages):
        self.loop.call_later(seconds, self.harness.receive, *messages)

    def beats_later(self, seconds, **beat):
        self.loop.call_later(seconds, lambda: self.harness.beat(**beat))


@pytest.fixture
def talk(run_in_sim_time, harness):
    """Run a test with a Talk."""
    return lambda test: run_in_sim_time(_with(test, harness))


async def _with(test, harness):
    await test(Talk(harness))


def ack(result, command=MavCmd.COMPONENT_ARM_DISARM):
    return CommandAck(command, result)


def test_an_accepted_command_is_sent_once_and_addressed(talk):
    async def test(it):
        it.later(0.01, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)
        (sent,) = it.sent
        assert (sent.target_system, sent.target_component, sent.confirmation) == (1, 1, 0)

    talk(test)


def test_an_unanswered_command_is_sent_four_times_a_second_apart_counting(talk):
    async def test(it):
        began = it.loop.time()
        with pytest.raises(TimedOut, match="did not answer COMPONENT_ARM_DISARM"):
            await it.commander.request(ARM)
        assert it.loop.time() - began == pytest.approx(4.0, abs=0.1)
        assert [sent.confirmation for sent in it.sent] == [0, 1, 2, 3]

    talk(test)


def test_a_command_with_a_place_is_repeated_as_it_is(talk):
    async def test(it):
        it.later(1.5, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))
        await it.commander.request(CommandInt(MavCmd.DO_REPOSITION, x=5))
        assert it.sent[0] == it.sent[1]

    talk(test)


def test_the_answer_to_another_command_is_none_to_this_one(talk):
    async def test(it):
        it.later(0.1, ack(MavResult.FAILED, MavCmd.NAV_TAKEOFF))
        it.later(0.2, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)

    talk(test)


def test_answers_to_what_was_never_asked_are_counted_and_late_ones_are_not(talk):
    async def test(it):
        it.later(
            0.1, ack(MavResult.ACCEPTED), ack(MavResult.ACCEPTED), ack(MavResult.ACCEPTED, MavCmd.NAV_TAKEOFF)
        )
        await it.commander.request(ARM)
        await asyncio.sleep(0.1)
        assert it.harness.vehicle.trust.counts == {NEVER_SENT: 1}

    talk(test)


def test_an_answer_that_came_before_is_none_to_this_one(talk):
    async def test(it):
        it.harness.receive(ack(MavResult.FAILED))
        it.later(0.2, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)

    talk(test)


@pytest.mark.parametrize("before", [0.005, 0.015])
def test_a_refusal_is_reported_in_the_autopilots_words_whether_they_come_first_or_last(talk, before):
    async def test(it):
        it.later(
            before,
            StatusTextMessage(2, "Arm: Need Position Estimate"),
            StatusTextMessage(2, "Arm: Gyros inconsistent"),
        )
        it.later(0.01, ack(MavResult.FAILED))
        with pytest.raises(Refused) as refused:
            await it.commander.request(ARM)
        assert refused.value.reason == "Arm: Need Position Estimate; Arm: Gyros inconsistent"
        assert refused.value.messages == ("Arm: Need Position Estimate", "Arm: Gyros inconsistent")
        assert refused.value.device_result == "FAILED"

    talk(test)


def test_what_was_said_before_the_command_is_no_reason(talk):
    async def test(it):
        it.harness.receive(StatusTextMessage(2, "PreArm: Old news"))
        await asyncio.sleep(1)
        it.later(0.01, ack(MavResult.DENIED))
        with pytest.raises(Refused, match="the autopilot answered DENIED to COMPONENT_ARM_DISARM"):
            await it.commander.request(ARM)

    talk(test)


def test_small_talk_is_no_reason_where_there_is_trouble(talk):
    async def test(it):
        it.later(
            0.005,
            StatusTextMessage(6, "EKF3 IMU0 is using GPS"),
            StatusTextMessage(2, "Arm: Throttle too high"),
        )
        it.later(0.01, ack(MavResult.FAILED))
        with pytest.raises(Refused) as refused:
            await it.commander.request(ARM)
        assert refused.value.reason == "Arm: Throttle too high"

    talk(test)


@pytest.mark.parametrize(
    ("result", "error"),
    [
        (MavResult.DENIED, Refused),
        (MavResult.FAILED, Refused),
        (MavResult.CANCELLED, Refused),
        (MavResult.UNSUPPORTED, Unsupported),
        (MavResult.COMMAND_INT_ONLY, Unsupported),
        (99, Refused),
    ],
)
def test_each_refusal_has_its_meaning_and_is_not_asked_again(talk, result, error):
    async def test(it):
        it.later(0.01, ack(result))
        with pytest.raises(error) as refused:
            await it.commander.request(ARM)
        assert refused.value.device_result
        assert len(it.sent) == 1

    talk(test)


def test_what_is_rejected_for_the_moment_is_asked_again(talk):
    async def test(it):
        it.later(0.01, ack(MavResult.TEMPORARILY_REJECTED))
        it.later(0.6, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)
        assert len(it.sent) == 2

    talk(test)


def test_what_stays_rejected_is_not_ready(talk):
    async def test(it):
        for at in range(1, 10):
            it.later(at * 0.5, ack(MavResult.TEMPORARILY_REJECTED))
        with pytest.raises(NotReady) as refused:
            await it.commander.request(ARM)
        assert refused.value.device_result == "TEMPORARILY_REJECTED"
        assert len(it.sent) < 8

    talk(test)


def test_work_in_progress_is_waited_for_and_not_asked_again(talk):
    async def test(it):
        for at in (0.1, 3.0, 7.0):
            it.later(at, ack(MavResult.IN_PROGRESS))
        it.later(10.0, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)
        assert len(it.sent) == 1

    talk(test)


def test_work_that_never_ends_is_reported(talk):
    async def test(it):
        it.later(0.1, ack(MavResult.IN_PROGRESS))
        with pytest.raises(TimedOut, match="did not say how it ended"):
            await it.commander.request(ARM)
        assert len(it.sent) == 1

    talk(test)


def test_what_was_seen_to_be_done_is_not_sent_again(talk):
    async def test(it):
        it.beats_later(0.9, armed=True)
        await it.commander.request(ARM, seen=lambda state: state.armed)
        assert len(it.sent) == 1

    talk(test)


def test_a_refused_repetition_of_what_was_done_is_no_refusal(talk):
    async def test(it):
        it.later(1.1, ack(MavResult.FAILED))
        it.beats_later(1.5, armed=True)
        await it.commander.request(ARM, seen=lambda state: state.armed)
        assert len(it.sent) == 2

    talk(test)


def test_commands_go_one_after_the_other(talk):
    async def test(it):
        first = asyncio.ensure_future(it.commander.request(ARM))
        second = asyncio.ensure_future(it.commander.request(CommandLong(MavCmd.NAV_TAKEOFF)))
        await asyncio.sleep(0.1)
        assert [sent.command for sent in it.sent] == [MavCmd.COMPONENT_ARM_DISARM]
        it.harness.receive(ack(MavResult.ACCEPTED))
        await first
        it.later(0.1, ack(MavResult.ACCEPTED, MavCmd.NAV_TAKEOFF))
        await second

    talk(test)


def test_something_urgent_ends_what_is_under_way_at_once(talk):
    async def test(it):
        doing = asyncio.ensure_future(it.commander.request(ARM))
        await asyncio.sleep(0.1)
        began = it.loop.time()
        it.commander.turns.supersede("stop")
        with pytest.raises(Refused, match="superseded: stop"):
            await doing
        assert it.loop.time() == began

    talk(test)


def test_what_is_nobodys_wish_holds_up_no_command_though_it_is_not_answered(talk):
    """A stream that is asked for, and not answered, kept commands waiting for a second."""

    async def test(it):
        rate = CommandLong(MavCmd.SET_MESSAGE_INTERVAL, param1=32.0)
        requested = [
            asyncio.ensure_future(it.commander.request(rate, tries=1, yields=True)) for _ in range(2)
        ]
        await asyncio.sleep(0.1)
        began = it.loop.time()
        it.later(0.05, ack(MavResult.ACCEPTED))
        await it.commander.request(ARM)
        assert it.loop.time() - began == pytest.approx(0.05)
        assert all(
            isinstance(end, Refused) for end in await asyncio.gather(*requested, return_exceptions=True)
        )
        assert [sent.command for sent in it.sent] == [
            MavCmd.SET_MESSAGE_INTERVAL,
            MavCmd.COMPONENT_ARM_DISARM,
        ]

    talk(test)


def test_what_yields_waits_for_a_command_that_is_under_way(talk):
    async def test(it):
        doing = asyncio.ensure_future(it.commander.request(ARM))
        await asyncio.sleep(0.1)
        it.later(0.2, ack(MavResult.ACCEPTED))
        it.later(0.3, ack(MavResult.ACCEPTED, MavCmd.SET_MESSAGE_INTERVAL))
        await it.commander.request(CommandLong(MavCmd.SET_MESSAGE_INTERVAL), tries=1, yields=True)
        assert doing.done()

    talk(test)


def test_what_is_more_urgent_does_not_wait_behind_what_waits_for_its_turn(talk):
    async def test(it):
        queue = [asyncio.ensure_future(it.commander.request(ARM)) for _ in range(4)]
        await asyncio.sleep(0.1)
        began = it.loop.time()
        it.commander.turns.supersede("stop")
        it.later(0.1, ack(MavResult.ACCEPTED, MavCmd.DO_SET_MODE))
        await it.commander.request(offboard())
        assert it.loop.time() - began == pytest.approx(0.1)
        ends = await asyncio.gather(*queue, return_exceptions=True)
        assert [str(end) for end in ends] == ["superseded: stop"] * 4
        assert [sent.command for sent in it.sent] == [MavCmd.COMPONENT_ARM_DISARM, MavCmd.DO_SET_MODE]

    talk(test)


def test_what_was_superseded_while_it_waited_to_ask_again_is_not_sent_again(talk):
    async def test(it):
        doing = asyncio.ensure_future(it.commander.request(ARM))
        it.later(0.1, ack(MavResult.TEMPORARILY_REJECTED))
        await asyncio.sleep(0.2)
        it.commander.turns.supersede("stop")
        with pytest.raises(Refused, match="superseded: stop"):
            await doing
        assert len(it.sent) == 1

    talk(test)


def offboard():
    return Px4().mode_command("OFFBOARD")


def test_a_mode_is_believed_from_the_heartbeat_only(talk):
    async def test(it):
        it.later(0.003, ack(MavResult.ACCEPTED, MavCmd.DO_SET_MODE))
        it.beats_later(0.9, mode=OFFBOARD)
        await it.commander.enter("OFFBOARD", MODE, offboard())
        assert MODE(it.harness.vehicle.state) == "OFFBOARD"

    talk(test)


def test_px4s_second_answer_refuses_a_mode(talk):
    async def test(it):
        it.later(0.003, ack(MavResult.ACCEPTED, MavCmd.DO_SET_MODE))
        it.later(0.012, ack(MavResult.TEMPORARILY_REJECTED, MavCmd.DO_SET_MODE))
        it.later(0.013, StatusTextMessage(2, "Switching to Offboard is currently not available\t"))
        it.beats_later(0.8)
        with pytest.raises(NotReady, match="Switching to Offboard is currently not available"):
            await it.commander.enter("OFFBOARD", MODE, offboard())

    talk(test)


def test_a_late_refusal_of_the_last_mode_is_not_taken_for_this_one(talk):
    async def test(it):
        it.later(0.001, ack(MavResult.TEMPORARILY_REJECTED, MavCmd.DO_SET_MODE))
        it.beats_later(0.002)
        it.beats_later(0.9, mode=OFFBOARD)
        await it.commander.enter("OFFBOARD", MODE, offboard())

    talk(test)


def test_a_mode_that_never_shows_is_asked_for_four_times(talk):
    async def test(it):
        for at in range(1, 8):
            it.beats_later(float(at))
        with pytest.raises(TimedOut, match=r"does not change to OFFBOARD, it stays in AUTO\.LOITER"):
            await it.commander.enter("OFFBOARD", MODE, offboard())
        assert len(it.sent) == 4

    talk(test)


def test_a_mode_that_it_is_in_is_asked_for_all_the_same(talk):
    async def test(it):
        it.later(0.01, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))
        await it.commander.enter("AUTO.LOITER", MODE, Px4().hold_command(VehicleState()))
        assert len(it.sent) == 1

    talk(test)


def test_a_change_of_mode_gives_way_to_something_urgent(talk):
    async def test(it):
        doing = asyncio.ensure_future(it.commander.enter("OFFBOARD", MODE, offboard()))
        await asyncio.sleep(0.1)
        it.commander.turns.supersede("stop")
        it.harness.receive(StatusTextMessage(6, "anything"))
        with pytest.raises(Refused, match="superseded: stop"):
            await doing

    talk(test)


def test_a_late_answer_to_an_equal_command_is_not_taken_for_this_ones(talk):
    async def test(it):
        overtaken = asyncio.ensure_future(it.commander.request(CommandLong(MavCmd.NAV_TAKEOFF, param7=3.0)))
        await asyncio.sleep(0.1)
        overtaken.cancel()
        it.later(0.2, ack(MavResult.ACCEPTED, MavCmd.NAV_TAKEOFF))
        it.later(0.4, ack(MavResult.FAILED, MavCmd.NAV_TAKEOFF))
        with pytest.raises(Refused):
            await it.commander.request(CommandLong(MavCmd.NAV_TAKEOFF, param7=5.0))

    talk(test)


def test_a_command_whose_answer_may_be_that_of_the_one_before_is_sent_again(talk):
    async def test(it):
        overtaken = asyncio.ensure_future(it.commander.request(CommandLong(MavCmd.NAV_TAKEOFF, param7=3.0)))
        await asyncio.sleep(0.1)
        overtaken.cancel()
        it.later(0.2, ack(MavResult.ACCEPTED, MavCmd.NAV_TAKEOFF))
        it.later(1.5, ack(MavResult.ACCEPTED, MavCmd.NAV_TAKEOFF))
        await it.commander.request(CommandLong(MavCmd.NAV_TAKEOFF, param7=5.0))
        assert [sent.param7 for sent in it.sent] == [3.0, 5.0, 5.0]

    talk(test)


def test_a_late_answer_to_where_it_was_to_go_is_not_taken_for_the_holds(talk):
    async def test(it):
        px4 = Px4()
        go = px4.go_command(GeoPoint(47.0, 8.0, 500.0), 488.0, 5.0, None)
        going = asyncio.ensure_future(it.commander.enter("AUTO.LOITER", MODE, go))
        await asyncio.sleep(0.1)
        it.commander.turns.supersede("stop")
        await asyncio.gather(going, return_exceptions=True)
        it.later(0.1, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))  # to ``go``; the first hold is lost
        it.later(1.5, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))
        await it.commander.enter("AUTO.LOITER", MODE, px4.hold_command(VehicleState()))
        assert [type(sent) for sent in it.sent] == [CommandInt, CommandLong, CommandLong]

    talk(test)


def test_an_answer_that_came_in_time_is_not_waited_for_twice(talk):
    async def test(it):
        hold = Px4().hold_command(VehicleState())
        for _ in range(2):
            it.later(0.1, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))
            await it.commander.enter("AUTO.LOITER", MODE, hold)
        assert len(it.sent) == 2

    talk(test)


def test_a_mode_that_it_is_in_is_asked_for_again_if_another_one_was_carried_out_after_it(talk):
    async def test(it):
        land = CommandLong(MavCmd.DO_SET_MODE, param1=1.0, param2=4.0, param3=6.0)
        overtaken = asyncio.ensure_future(it.commander.enter("AUTO.LAND", MODE, land))
        await asyncio.sleep(0.05)
        overtaken.cancel()  # its frame is overtaken by the next one
        for seconds in (0.05, 0.75):
            it.later(seconds, ack(MavResult.ACCEPTED, MavCmd.DO_REPOSITION))
        it.beats_later(0.7, mode=LAND, armed=True)
        it.beats_later(1.7, mode=LOITER, armed=True)
        await it.commander.enter("AUTO.LOITER", MODE, CommandInt(MavCmd.DO_REPOSITION))
        assert [sent.command for sent in it.sent[1:]] == [MavCmd.DO_REPOSITION] * 2

    talk(test)
