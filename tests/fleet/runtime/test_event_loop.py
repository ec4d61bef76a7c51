"""Tasks that begin at once."""

import asyncio

import pytest

from fleet.runtime.event_loop import OWNER, start_task


async def called(call):
    """Call a function from the loop, not from a task, and return its result."""
    result = asyncio.get_running_loop().create_future()
    asyncio.get_running_loop().call_soon(lambda: result.set_result(call()))
    return await result


@pytest.fixture
def seen():
    """Return what the work did, in order."""
    return []


@pytest.fixture
def begin(seen):
    """Start a task that waits once."""

    async def work():
        seen.append(asyncio.current_task().get_name())
        async with asyncio.timeout(1):
            await asyncio.sleep(0.01)
        seen.append("ended")

    def begin(name="work"):
        task = start_task(asyncio.get_running_loop(), work(), name=name)
        seen.append("started")
        return task

    return begin


async def test_a_task_runs_up_to_its_first_wait_before_it_is_returned(seen, begin):
    task = await called(begin)
    assert seen == ["work", "started"]
    await task
    assert seen == ["work", "started", "ended"]


async def test_a_task_that_another_starts_begins_soon(seen, begin):
    task = begin()
    assert seen == ["started"]
    await task
    assert seen == ["started", "work", "ended"]


async def test_work_without_a_wait_is_done_and_an_error_is_in_its_task():
    async def fails():
        raise ValueError("no")

    task = await called(lambda: start_task(asyncio.get_running_loop(), fails(), name="fails"))
    assert str(task.exception()) == "no"


async def test_a_task_that_begins_at_once_has_its_owner(begin):
    def own():
        OWNER.set("rex")
        return begin()

    assert (await called(own)).owner == "rex"


async def test_later_calls_reach_the_loop_again(seen, begin):
    await called(begin)
    asyncio.get_running_loop().call_soon(seen.append, "called")
    await asyncio.sleep(0)
    assert "called" in seen
