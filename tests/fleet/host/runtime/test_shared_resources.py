import asyncio
from contextlib import asynccontextmanager

import pytest

from fleet.errors import LinkRefused
from fleet.host.runtime.shared_resources import SharedResources
from fleet.runtime.event_loop import OWNER


class Port:
    """A resource that can be open only once at a time, and takes a moment to close."""

    def __init__(self):
        self.log = []
        self.taken = False
        self.may_close = asyncio.Event()
        self.may_close.set()
        self.owner = None

    @asynccontextmanager
    async def open(self):
        if self.taken:
            raise LinkRefused("the port is taken")
        self.taken, self.owner = True, OWNER.get()
        self.log.append("open")
        try:
            yield self
        finally:
            await self.may_close.wait()
            self.taken = False
            self.log.append("close")


@pytest.fixture
async def port():
    return Port()


async def user(shared, port, leave, key="p"):
    async with shared.share(key, port.open) as value:
        assert value is port
        await leave.wait()


async def test_two_robots_share_one_and_the_last_closes_it(port, requests):
    shared, first, second = SharedResources(), asyncio.Event(), asyncio.Event()
    one = asyncio.create_task(user(shared, port, first))
    two = asyncio.create_task(user(shared, port, second))
    await requests.settle()
    first.set()
    await one
    assert port.log == ["open"]
    second.set()
    await two
    assert port.log == ["open", "close"]


async def test_one_who_comes_while_it_is_closing_gets_a_new_one(port, requests):
    shared, leave = SharedResources(), asyncio.Event()
    port.may_close.clear()
    leave.set()
    one = asyncio.create_task(user(shared, port, leave))
    await requests.settle()
    two = asyncio.create_task(user(shared, port, leave))
    await requests.settle()
    port.may_close.set()
    await asyncio.gather(one, two)
    assert port.log == ["open", "close", "open", "close"]


async def test_one_that_cannot_be_opened_fails_all_who_wait_and_is_tried_again(port, requests):
    shared, leave = SharedResources(), asyncio.Event()
    leave.set()
    port.taken = True
    results = await asyncio.gather(
        user(shared, port, leave), user(shared, port, leave), return_exceptions=True
    )
    assert [type(result) for result in results] == [LinkRefused, LinkRefused]
    port.taken = False
    await user(shared, port, leave)
    assert port.log == ["open", "close"]


async def test_a_user_that_is_cancelled_does_not_close_it_for_the_other(port, requests):
    shared, leave = SharedResources(), asyncio.Event()
    one = asyncio.create_task(user(shared, port, leave))
    two = asyncio.create_task(user(shared, port, leave))
    await requests.settle()
    one.cancel()
    await requests.settle()
    assert port.log == ["open"]
    leave.set()
    await two


async def test_closing_goes_on_though_the_last_user_is_cancelled_twice(port, requests):
    shared = SharedResources()
    port.may_close.clear()
    one = asyncio.create_task(user(shared, port, asyncio.Event()))
    await requests.settle()
    for _ in range(2):
        one.cancel()
        await requests.settle()
    port.may_close.set()
    await requests.settle()
    assert one.cancelled()
    assert port.log == ["open", "close"]


async def test_what_all_use_belongs_to_nobody(port, requests):
    leave = asyncio.Event()
    leave.set()
    token = OWNER.set("rex")
    await user(SharedResources(), port, leave)
    OWNER.reset(token)
    assert port.owner == ""
