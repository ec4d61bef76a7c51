import asyncio

import pytest

from fleet.host.runtime.cancellation import closing, end_task, wait_bounded


async def test_what_ends_in_time_returns_its_value():
    assert await wait_bounded(asyncio.sleep(0, "value"), 20) == "value"


async def test_what_takes_too_long_is_cancelled():
    began = asyncio.Event()

    async def slow():
        began.set()
        await asyncio.Event().wait()

    with pytest.raises(TimeoutError):
        await wait_bounded(slow(), 0.01)
    assert began.is_set()


async def test_a_task_that_swallowed_its_cancellation_is_cancelled_again(monkeypatch):
    monkeypatch.setattr("fleet.host.runtime.cancellation.AGAIN_AFTER", 0.01)
    swallowed = []

    async def swallow():
        while True:
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                if len(swallowed) == 2:
                    raise
                swallowed.append(1)

    task = asyncio.create_task(swallow())
    await asyncio.sleep(0)
    async with asyncio.timeout(20):
        await end_task(task)
    assert task.cancelled()
    assert len(swallowed) == 2


async def test_what_ignores_its_cancellation_is_left_behind(requests):
    free = asyncio.Event()

    async def on_ignored():
        while not free.is_set():
            try:
                await free.wait()
            except asyncio.CancelledError:
                continue
        raise ValueError("nobody asks any more")

    with pytest.raises(TimeoutError):
        await wait_bounded(on_ignored(), 0.01)
    free.set()
    await requests.settle()


async def test_a_stray_cancellation_inside_is_not_taken_for_ones_own():
    async def stray():
        raise asyncio.CancelledError

    with pytest.raises(RuntimeError, match="from within"):
        await wait_bounded(stray(), 20)


async def test_who_waits_can_be_cancelled_and_takes_the_work_with_him(requests):
    ended = asyncio.Event()

    async def work():
        try:
            await asyncio.Event().wait()
        finally:
            ended.set()

    task = asyncio.create_task(wait_bounded(work(), 20))
    await requests.settle()
    task.cancel()
    await asyncio.wait({task})
    await requests.settle()
    assert ended.is_set()


async def test_an_iteration_without_a_close_is_iterated_all_the_same():
    class Steps:
        def __aiter__(self):
            return self

        async def __anext__(self):
            raise StopAsyncIteration

    async with closing(Steps()) as steps:
        assert [step async for step in steps] == []
