"""Waiting for what a vehicle shows."""

import asyncio
import time


async def test_what_comes_while_the_computer_is_late_is_seen_all_the_same(harness):
    it = harness()
    it.beat()
    waiting = asyncio.ensure_future(it.vehicle.until(lambda state: state.armed, 0.02))
    await asyncio.sleep(0)
    asyncio.get_running_loop().call_later(0.021, lambda: it.beat(armed=True))
    time.sleep(0.05)  # noqa: ASYNC251 - a busy computer: both are due at once, the end of the wait first
    assert await waiting


async def test_a_wait_ends_without_what_never_comes(harness):
    it = harness()
    it.beat()
    assert not await it.vehicle.until(lambda state: state.armed, 0.01)
