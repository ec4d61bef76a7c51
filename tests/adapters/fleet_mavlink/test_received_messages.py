"""What a vehicle said during an exchange with it: kept in order, and each taken once."""

import asyncio

import pytest

from fleet_mavlink.messages import CommandAck, MissionItemReached
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.statustext import Sentence


def acks(*commands):
    heard = ReceivedMessages((CommandAck,))
    for command in commands:
        heard.put(CommandAck(command, 0))
    return heard


@pytest.fixture
def timed(run_in_sim_time):
    """Run a test in a loop whose time jumps; it is given that time."""

    def timed(test):
        async def main():
            await test(asyncio.get_running_loop().time)

        run_in_sim_time(main())

    return timed


def later(seconds, heard, *messages):
    loop = asyncio.get_running_loop()
    for message in messages:
        loop.call_later(seconds, heard.put, message)


def test_messages_are_taken_in_the_order_they_came_and_once(timed):
    async def test(now):
        heard = acks(1, 2)
        assert [(await heard.next(1.0)).command for _ in range(2)] == [1, 2]
        assert await heard.next(1.0) is None

    timed(test)


def test_other_messages_than_the_wanted_ones_are_not_kept(timed):
    async def test(now):
        heard = ReceivedMessages((CommandAck, Sentence))
        said = Sentence("Disarmed", 6, 1.0)
        for each in (MissionItemReached(3), said, CommandAck(1, 0)):
            heard.put(each)
        assert await heard.next(1.0) is said
        assert await heard.next(1.0) == CommandAck(1, 0)

    timed(test)


def test_a_message_that_is_there_is_taken_also_without_any_time_left(timed):
    async def test(now):
        began = now()
        assert (await acks(1).next(0.0)).command == 1
        assert await acks().next(0.0) is None
        assert now() == began

    timed(test)


def test_a_message_that_comes_in_time_is_waited_for_no_longer_than_that(timed):
    async def test(now):
        heard, began = acks(), now()
        later(0.4, heard, CommandAck(1, 0))
        assert await heard.next(1.0) == CommandAck(1, 0)
        assert now() - began == pytest.approx(0.4, abs=0.01)
        assert await heard.next(1.0) is None
        assert now() - began == pytest.approx(1.4, abs=0.01)

    timed(test)


def test_the_first_wanted_message_is_found_behind_others_which_are_used_up(timed):
    async def test(now):
        heard = acks(1, 2, 3)
        assert (await heard.first(lambda said: said.command == 2, 1.0)).command == 2
        assert (await heard.next(0.0)).command == 3

    timed(test)


def test_unwanted_messages_do_not_lengthen_the_wait_for_the_first_wanted_one(timed):
    async def test(now):
        heard, began = acks(), now()
        for tenth in range(30):
            later(tenth / 10, heard, CommandAck(7, 0))
        later(2.5, heard, CommandAck(1, 0))
        assert await heard.first(lambda said: said.command == 1, 2.0) is None
        assert now() - began == pytest.approx(2.0, abs=0.01)
        assert (await heard.first(lambda said: said.command == 1, 1.0)).command == 1

    timed(test)


def test_of_a_flood_the_first_4096_are_kept(timed):
    async def test(now):
        heard = acks(*range(4100))
        kept = [(await heard.next(0.0)).command for _ in range(4096)]
        assert kept == list(range(4096))
        assert await heard.next(0.0) is None
        heard.put(CommandAck(1, 0))
        assert await heard.next(0.0) is not None, "there is room again"

    timed(test)
