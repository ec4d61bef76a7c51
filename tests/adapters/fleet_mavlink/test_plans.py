"""Plans sent to a vehicle that asks for their items, refuses, repeats itself, or falls silent."""

import asyncio

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.mission_messages import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
)
from fleet_mavlink.plans import Plans, PlanType

MISSION, FENCE = PlanType.MISSION, PlanType.FENCE
WAYPOINT = 16
ACCEPTED, ERROR, INVALID_SEQUENCE, DENIED, CANCELLED = 0, 1, 13, 14, 15


def item(x, *, seq=0, kind=MISSION):
    return MissionItemInt(0, 0, seq, 3, WAYPOINT, x=x, z=10.0, mission_type=kind)


def ack(result, kind=MISSION):
    return MissionAck(245, 191, result, kind)


def ask(seq, kind=MISSION, how=MissionRequestInt):
    return how(245, 191, seq, kind)


REFUSALS = {
    number: each.name.removeprefix("MAV_MISSION_")
    for number, each in mav.enums["MAV_MISSION_RESULT"].items()
    if number in range(1, 15) and number != INVALID_SEQUENCE
}
ITEMS = [item(100), item(200), item(300)]


@pytest.fixture
def with_autopilot(run_answered):
    """Run a test with the plans of a vehicle that answers by a function, and with what was sent to it."""
    return lambda answer, test: run_answered(answer, lambda it: test(Plans(it.vehicle), it))


def taker(items, kind=MISSION, *, how=MissionRequestInt, end=ACCEPTED):
    """Return an autopilot that asks for one item after the other."""

    def answer(message):
        if isinstance(message, MissionCount):
            return [ask(0, kind, how)] if message.count else [ack(end, kind)]
        if isinstance(message, MissionItemInt):
            following = message.seq + 1
            return [ask(following, kind, how) if following < len(items) else ack(end, kind)]
        return []

    return answer


@pytest.mark.parametrize("kind", PlanType)
@pytest.mark.parametrize("how", [MissionRequest, MissionRequestInt])
def test_items_are_sent_as_they_are_asked_for_numbered_and_addressed(with_autopilot, kind, how):
    async def test(plans, it):
        await plans.upload(kind, ITEMS)
        assert it.sent.of(MissionCount) == [MissionCount(1, 1, 3, kind)]
        sent = it.sent.of(MissionItemInt)
        assert [(each.seq, each.x, each.mission_type) for each in sent] == [
            (0, 100, kind),
            (1, 200, kind),
            (2, 300, kind),
        ]
        assert {(each.target_system, each.target_component) for each in sent} == {(1, 1)}

    with_autopilot(taker(ITEMS, kind, how=how), test)


def test_of_two_requests_at_once_the_newest_is_answered(with_autopilot):
    def answer(message):
        if isinstance(message, MissionCount):
            return [ask(0, how=MissionRequest), ask(0), ask(1)]
        if isinstance(message, MissionItemInt):
            return [ack(INVALID_SEQUENCE), {1: ask(0), 0: ask(2), 2: ack(ACCEPTED)}[message.seq]]
        return []

    async def test(plans, it):
        await plans.upload(MISSION, ITEMS)
        assert [each.seq for each in it.sent.of(MissionItemInt)] == [1, 0, 2]

    with_autopilot(answer, test)


def test_what_is_said_of_another_plan_or_of_a_download_is_no_part_of_an_upload(with_autopilot):
    def answer(message):
        others = [ask(0, FENCE), ack(DENIED, FENCE), MissionCount(245, 191, 7), item(5)]
        return [*others, *taker(ITEMS)(message), *others]

    async def test(plans, it):
        await plans.upload(MISSION, ITEMS)
        assert len(it.sent.of(MissionItemInt)) == 3

    with_autopilot(answer, test)


@pytest.mark.parametrize(("result", "name"), [*REFUSALS.items(), (16, "result 16"), (99, "result 99")])
def test_a_refused_plan_is_refused_by_the_autopilots_name_for_it(with_autopilot, result, name):
    async def test(plans, it):
        with pytest.raises(Refused) as caught:
            await plans.upload(FENCE, ITEMS)
        assert caught.value.reason == f"the autopilot refused the fence: {name}"
        assert caught.value.device_result == name

    with_autopilot(lambda message: [ack(result, FENCE)], test)


@pytest.mark.parametrize("seq", [3, 65535])
def test_an_item_beyond_the_plan_is_not_there_to_send(with_autopilot, seq):
    async def test(plans, it):
        with pytest.raises(Refused, match=f"system 1 asks for item {seq} of 3"):
            await plans.upload(MISSION, ITEMS)
        assert it.sent.of(MissionItemInt) == []

    with_autopilot(lambda message: [ask(seq)], test)


def test_an_item_that_is_asked_for_again_and_again_ends_the_transfer(with_autopilot):
    async def test(plans, it):
        with pytest.raises(TimedOut, match="system 1 does not take item 0"):
            await plans.upload(MISSION, ITEMS)
        assert len(it.sent.of(MissionItemInt)) == 50

    with_autopilot(lambda message: [ask(0)], test)


def test_a_vehicle_that_asks_for_nothing_is_told_of_the_plan_in_three_transfers_of_five_tries(with_autopilot):
    async def test(plans, it):
        began = asyncio.get_running_loop().time()
        with pytest.raises(TimedOut, match="system 1 stopped asking for its mission") as caught:
            await plans.upload(MISSION, ITEMS)
        assert caught.value.hint == "0 of 3 items were sent; is the link good?"
        assert len(it.sent.of(MissionCount)) == 15
        assert asyncio.get_running_loop().time() - began == pytest.approx(15 * 1.5, abs=0.1)

    with_autopilot(lambda message: [], test)


def test_a_vehicle_that_stops_asking_is_told_how_far_it_came(with_autopilot):
    def answer(message):
        return [ask(0)] if isinstance(message, MissionCount) else []

    async def test(plans, it):
        with pytest.raises(TimedOut) as caught:
            await plans.upload(MISSION, ITEMS)
        assert caught.value.hint == "1 of 3 items were sent; is the link good?"
        assert len(it.sent.of(MissionCount)) == 3, "once in each transfer: then it has begun"

    with_autopilot(answer, test)


@pytest.mark.parametrize("ends", [1, 2, 3])
def test_a_transfer_that_the_vehicle_breaks_off_is_begun_again_twice(with_autopilot, ends):
    counts = []

    def answer(message):
        if isinstance(message, MissionCount):
            counts.append(message)
        broken = len(counts) <= ends and isinstance(message, MissionItemInt)
        return [ack(CANCELLED)] if broken else taker(ITEMS)(message)

    async def test(plans, it):
        if ends < 3:
            await plans.upload(MISSION, ITEMS)
        else:
            with pytest.raises(TimedOut, match="stopped asking"):
                await plans.upload(MISSION, ITEMS)
        assert len(counts) == min(ends + 1, 3)

    with_autopilot(answer, test)


def test_a_lost_end_is_none_of_a_plan_whose_items_were_all_asked_for(with_autopilot):
    def answer(message):
        return [each for each in taker(ITEMS)(message) if not isinstance(each, MissionAck)]

    async def test(plans, it):
        began = asyncio.get_running_loop().time()
        await plans.upload(MISSION, ITEMS)
        assert len(it.sent.of(MissionItemInt)) == 3
        assert asyncio.get_running_loop().time() - began < 2.0, "one silence is enough"

    with_autopilot(answer, test)


def test_the_end_of_an_upload_is_not_overtaken_by_a_late_request(with_autopilot):
    def answer(message):
        late = [ask(0)] if isinstance(message, MissionItemInt) and message.seq == 2 else []
        return [*taker(ITEMS)(message), *late]

    async def test(plans, it):
        await plans.upload(MISSION, ITEMS)
        assert len(it.sent.of(MissionItemInt)) == 3

    with_autopilot(answer, test)


def test_a_vehicle_that_fell_silent_is_not_told_of_the_plan_again(with_autopilot):
    async def test(plans, it):
        it.silent = True
        with pytest.raises(NotReady, match="no heartbeat from system 1"):
            await plans.upload(MISSION, ITEMS)
        assert len(it.sent.of(MissionCount)) == 5
        for transfer in (plans.upload(MISSION, ITEMS), plans.download(MISSION), plans.clear(MISSION)):
            with pytest.raises(NotReady, match="no heartbeat from system 1"):
                await transfer
        assert len(it.sent) == 5

    with_autopilot(lambda message: [], test)


@pytest.mark.parametrize("kind", PlanType)
def test_a_plan_is_forgotten_when_the_vehicle_says_so_of_this_plan(with_autopilot, kind):
    async def test(plans, it):
        await plans.clear(kind)
        assert list(it.sent) == [MissionClearAll(1, 1, kind)]

    with_autopilot(lambda message: [ack(DENIED, 1 - kind), ack(ACCEPTED, kind)], test)


def test_a_plan_that_is_not_forgotten_is_told_with_the_autopilots_name_for_it(with_autopilot):
    async def test(plans, it):
        with pytest.raises(Refused, match="the autopilot refused to forget its fence: ERROR"):
            await plans.clear(FENCE)

    with_autopilot(lambda message: [ack(ERROR, FENCE)], test)


def test_a_vehicle_that_does_not_answer_is_told_five_times_to_forget(with_autopilot):
    async def test(plans, it):
        with pytest.raises(TimedOut, match="system 1 did not answer MissionClearAll"):
            await plans.clear(MISSION)
        assert it.sent.of(MissionClearAll) == it.sent == [MissionClearAll(1, 1, MISSION)] * 5

    with_autopilot(lambda message: [], test)
