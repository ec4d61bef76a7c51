"""Calls of an SDK that blocks: none waits for another, and those of a stop are never refused."""

import asyncio
import threading

import pytest

from fleet.errors import LinkLost, NotReady
from fleet.host.runtime.blocking_calls import MOST, STOPPING, BlockingCalls


class Sdk:
    """An SDK whose calls hang until they are let go."""

    def __init__(self):
        self.go = threading.Event()
        self.begun = threading.Semaphore(0)

    def hang(self):
        self.begun.release()
        assert self.go.wait(20)
        return "done"

    def begins(self):
        assert self.begun.acquire(timeout=20)


def threads_of_rex():
    return [each for each in threading.enumerate() if each.name == "fleet-sdk-rex"]


@pytest.fixture
def calls():
    return BlockingCalls("rex")


@pytest.fixture
async def sdk(calls):
    """Give an SDK with as many calls that hang as are permitted; they end with the test."""
    sdk = Sdk()
    sdk.hanging = [asyncio.ensure_future(calls.call(sdk.hang)) for _ in range(MOST)]
    await asyncio.sleep(0)
    for _ in range(MOST):
        sdk.begins()
    yield sdk
    sdk.go.set()
    await asyncio.gather(*sdk.hanging, return_exceptions=True)


async def test_a_call_has_its_arguments_and_its_result(calls):
    assert await calls.call(divmod, 7, 2) == (3, 1)
    assert await calls.call(sorted, [1, 3, 2], reverse=True) == [3, 2, 1]
    assert await calls.call(lambda call: call, call="its own") == "its own"


async def test_it_runs_on_a_thread_that_names_the_robot_and_ends_with_the_process(calls):
    thread = await calls.call(threading.current_thread)
    assert (thread.name, thread.daemon) == ("fleet-sdk-rex", True)
    assert thread is not threading.current_thread()


@pytest.mark.parametrize(
    ("error", "raised", "text"),
    [
        (LinkLost("no cable"), LinkLost, "no cable"),
        (ValueError("bad"), ValueError, "bad"),
        (SystemExit(1), RuntimeError, "sys.exit"),
        (GeneratorExit(), RuntimeError, "GeneratorExit"),
        (StopIteration(), RuntimeError, "StopIteration"),
    ],
)
async def test_whatever_a_call_raises_reaches_its_caller_and_ends_nothing_else(calls, error, raised, text):
    def fails():
        raise error

    with pytest.raises(raised, match=text):
        await asyncio.wait_for(calls.call(fails), 20)
    assert await calls.call(abs, -1) == 1


async def test_as_many_calls_as_permitted_hang_side_by_side(calls, sdk):
    sdk.go.set()
    assert await asyncio.gather(*sdk.hanging) == ["done"] * MOST
    assert await calls.call(abs, -1) == 1, "there is room again"


async def test_one_more_is_refused_with_what_to_do(calls, sdk):
    with pytest.raises(NotReady, match=f"{MOST} calls to its SDK hang") as error:
        await calls.call(abs, -1)
    assert error.value.hint == "restart the robot, then its adapter"
    assert await BlockingCalls("ada").call(abs, -1) == 1, "another robot's calls are its own"


async def test_a_stop_is_called_though_all_others_hang(calls, sdk):
    async def stop():
        STOPPING.set(True)
        return await calls.call(abs, -1)

    for _ in range(2 * MOST):
        assert await asyncio.wait_for(asyncio.ensure_future(stop()), 20) == 1
    with pytest.raises(NotReady):
        await calls.call(abs, -1)


async def test_a_call_that_nobody_waits_for_any_more_still_holds_its_thread(calls, sdk):
    for each in sdk.hanging:
        each.cancel()
    await asyncio.gather(*sdk.hanging, return_exceptions=True)
    with pytest.raises(NotReady):
        await calls.call(abs, -1)
    sdk.go.set()
    for thread in threads_of_rex():
        await asyncio.to_thread(thread.join, 20)
    await asyncio.sleep(0)
    assert await calls.call(abs, -1) == 1


async def test_where_no_thread_starts_the_call_is_refused_and_counts_no_more(calls, monkeypatch):
    def start(_thread):
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", start)
        for _ in range(MOST + 1):
            with pytest.raises(NotReady, match="no thread for a call to its SDK: can't start new thread"):
                await calls.call(abs, -1)
    assert await calls.call(abs, -1) == 1


def test_a_call_that_outlives_the_loop_is_no_error(calls):
    sdk = Sdk()

    async def leaves():
        call = asyncio.ensure_future(calls.call(sdk.hang))
        await asyncio.sleep(0)
        await asyncio.to_thread(sdk.begins)
        return call

    asyncio.run(leaves())
    (thread,) = threads_of_rex()
    sdk.go.set()
    thread.join(20)
    assert not thread.is_alive()
