"""A program beside the edge: its output heard, its end told, started again, ended by its parent."""

import asyncio
import contextlib
import os
import signal

from fleet.clock import SystemClock
from fleet.host.process.side_program import SideProgram, until_ended
from tests.tools.waiting import DEADLINE

SHORT = "calendar"  # a module of Python that prints something and ends


def program(said, module=SHORT):
    """Return a program whose output goes to a queue."""

    async def hear(process):
        said.put_nowait(await process.stdout.read())

    return SideProgram("calendar", module, b"{}", SystemClock(), hear, heard=True)


async def test_a_program_that_ends_is_reported_with_its_exit_code():
    ended = program(asyncio.Queue())
    await asyncio.wait_for(ended.run(again=False), DEADLINE)
    assert ended.problem == "the calendar ended with exit code 0"


async def test_a_program_that_ends_is_started_again():
    said = asyncio.Queue()
    running = asyncio.create_task(program(said).run())
    async with asyncio.timeout(DEADLINE):
        assert all([b"January" in await said.get() for _ in range(2)])
    running.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await running


async def test_its_own_side_ends_when_its_parent_is_gone():
    await asyncio.wait_for(until_ended(-1, asyncio.Event.wait), DEADLINE)


async def test_its_own_side_ends_by_a_signal():
    async def work(ended):
        os.kill(os.getpid(), signal.SIGTERM)
        await ended.wait()

    await asyncio.wait_for(until_ended(0, work), DEADLINE)
