"""Plans read from a vehicle: item by item, whatever else it says meanwhile."""

import asyncio

import pytest

from fleet import Refused, TimedOut
from fleet_mavlink.mission_messages import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
)
from fleet_mavlink.plans import Plans, PlanType

MISSION, FENCE = PlanType.MISSION, PlanType.FENCE
ACCEPTED, INVALID_SEQUENCE, DENIED, CANCELLED = 0, 13, 14, 15


def item(x, *, seq=0, kind=MISSION):
    return MissionItemInt(0, 0, seq, 3, 16, x=x, z=10.0, mission_type=kind)


def ack(result, kind=MISSION):
    return MissionAck(245, 191, result, kind)


ITEMS = [item(100), item(200), item(300)]


@pytest.fixture
def with_autopilot(run_answered):
    """Run a test with the plans of a vehicle that answers by a function, and with what was sent to it."""
    return lambda answer, test: run_answered(answer, lambda it: test(Plans(it.vehicle), it))


def giver(items, kind=MISSION):
    """Return an autopilot that gives its items."""

    def answer(message):
        if isinstance(message, MissionRequestList):
            return [MissionCount(245, 191, len(items), kind)]
        if isinstance(message, MissionRequestInt):
            return [item(items[message.seq].x, seq=message.seq, kind=kind)]
        return []

    return answer


@pytest.mark.parametrize("kind", PlanType)
def test_a_stored_plan_is_read_item_by_item_and_acknowledged(with_autopilot, kind):
    async def test(plans, it):
        assert [each.x for each in await plans.download(kind)] == [100, 200, 300]
        assert list(it.sent) == [
            MissionRequestList(1, 1, kind),
            *(MissionRequestInt(1, 1, seq, kind) for seq in range(3)),
            MissionAck(1, 1, ACCEPTED, kind),
        ]

    with_autopilot(giver(ITEMS, kind), test)


def test_a_plan_of_no_items_is_read_as_none(with_autopilot):
    async def test(plans, it):
        assert await plans.download(FENCE) == ()

    with_autopilot(giver([], FENCE), test)


@pytest.mark.parametrize("late", [INVALID_SEQUENCE, CANCELLED])
def test_what_is_said_of_something_else_is_no_part_of_a_download(with_autopilot, late):
    def answer(message):
        others = [ack(late), item(7, seq=9), MissionCount(245, 191, 9, FENCE), item(8, kind=FENCE)]
        return [*others, *giver(ITEMS)(message)]

    async def test(plans, it):
        assert [each.x for each in await plans.download(MISSION)] == [100, 200, 300]

    with_autopilot(answer, test)


def test_a_lost_answer_is_asked_for_again(with_autopilot):
    lost = [MissionRequestList(1, 1, 0), MissionRequestInt(1, 1, 1, 0), MissionRequestInt(1, 1, 1, 0)]

    def answer(message):
        if message in lost:
            lost.remove(message)
            return []
        return giver(ITEMS)(message)

    async def test(plans, it):
        assert [each.x for each in await plans.download(MISSION)] == [100, 200, 300]

    with_autopilot(answer, test)


@pytest.mark.parametrize("denials", [4, 5])
def test_a_vehicle_that_does_not_want_to_tell_yet_is_asked_five_times(with_autopilot, denials):
    asked = []

    def answer(message):
        if isinstance(message, MissionRequestList):
            asked.append(message)
            if len(asked) <= denials:
                return [ack(DENIED)]
        return giver(ITEMS)(message)

    async def test(plans, it):
        began = asyncio.get_running_loop().time()
        if denials == 4:
            assert len(await plans.download(MISSION)) == 3
        else:
            with pytest.raises(Refused, match="system 1 does not send its mission"):
                await plans.download(MISSION)
        assert asyncio.get_running_loop().time() - began > denials * 1.5

    with_autopilot(answer, test)


def test_a_vehicle_that_refuses_to_tell_its_plan_is_quoted(with_autopilot):
    async def test(plans, it):
        with pytest.raises(Refused, match="the autopilot refused to send its mission: UNSUPPORTED"):
            await plans.download(MISSION)

    with_autopilot(lambda message: [ack(3)], test)


def test_a_vehicle_that_refuses_one_item_is_quoted(with_autopilot):
    def answer(message):
        return [ack(DENIED)] if message == MissionRequestInt(1, 1, 1, 0) else giver(ITEMS)(message)

    async def test(plans, it):
        with pytest.raises(Refused, match="system 1 does not send item 1: DENIED"):
            await plans.download(MISSION)

    with_autopilot(answer, test)


def test_a_vehicle_that_answers_nothing_is_asked_five_times(with_autopilot):
    async def test(plans, it):
        began = asyncio.get_running_loop().time()
        with pytest.raises(TimedOut, match="system 1 did not answer MissionRequestList"):
            await plans.download(MISSION)
        assert len(it.sent) == 5
        assert asyncio.get_running_loop().time() - began == pytest.approx(5 * 1.5, abs=0.1)

    with_autopilot(lambda message: [], test)


def test_transfers_follow_one_after_the_other(with_autopilot):
    def answer(message):
        return [ack(ACCEPTED)] if isinstance(message, MissionClearAll) else giver(ITEMS)(message)

    async def test(plans, it):
        await asyncio.gather(plans.download(MISSION), plans.clear(MISSION), plans.download(MISSION))
        kinds = [type(each) for each in it.sent]
        one = [MissionRequestList, *[MissionRequestInt] * 3, MissionAck]
        assert kinds == [*one, MissionClearAll, *one]

    with_autopilot(answer, test)
