"""An event loop that never waits, and its clock."""

import asyncio
import threading
import time

from fleet.runtime.simulated_time import EPOCH, JumpingLoop, LoopClock


def in_simulated_time(work):
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(work())


def test_an_hour_passes_at_once_and_calls_come_in_their_order():
    async def work():
        loop, order = asyncio.get_running_loop(), []
        clock = LoopClock(loop)
        began = clock.monotonic(), clock.time()
        for seconds in (20, 10, 3600):
            loop.call_later(seconds, order.append, seconds)
        await asyncio.sleep(3601)
        return order, clock.monotonic() - began[0], clock.time() - began[1], began[1]

    began = time.monotonic()
    order, monotonic, unix, epoch = in_simulated_time(work)
    assert order == [10, 20, 3600]
    assert (round(monotonic, 3), round(unix, 3), epoch) == (3601.0, 3601.0, EPOCH)
    assert time.monotonic() - began < 60


def test_no_time_passes_while_a_call_that_blocks_is_made():
    async def work():
        clock = LoopClock(asyncio.get_running_loop())
        ticking = asyncio.create_task(asyncio.sleep(0.02))
        began = clock.monotonic()
        await asyncio.to_thread(time.sleep, 0.05)
        ticking.cancel()
        return clock.monotonic() - began

    assert in_simulated_time(work) == 0.0


def test_what_another_thread_hands_over_wakes_a_loop_that_waits_for_nothing_else():
    async def work():
        loop, done = asyncio.get_running_loop(), asyncio.Event()
        threading.Timer(0.01, loop.call_soon_threadsafe, (done.set,)).start()
        await done.wait()
        return True

    assert in_simulated_time(work)
