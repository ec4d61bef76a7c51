"""The recorder as a child process: started again when it dies; what is wrong is told in its own words."""

import asyncio
import contextlib
import os
import signal

from fleet.clock import SystemClock
from fleet.record.child import RecorderChild
from fleet.record.task import Bounds, RecordTask
from tests.tools.waiting import DEADLINE, wait_until


@contextlib.asynccontextmanager
async def running(child):
    task = asyncio.create_task(child.run())
    yield task
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


async def test_a_recorder_that_is_killed_is_started_again(runtime, tmp_path):
    child = RecorderChild(RecordTask(str(tmp_path / "recordings"), Bounds(free=0)), SystemClock())
    async with running(child), asyncio.timeout(DEADLINE):
        await child.recording.wait()
        first = child.process
        child.recording.clear()
        os.kill(first, signal.SIGKILL)
        await child.recording.wait()
        assert (child.process != first, child.problem) == (True, "")


async def test_why_it_cannot_record_is_reported(runtime, tmp_path):
    (tmp_path / "file").write_text("")
    child = RecorderChild(RecordTask(str(tmp_path / "file" / "recordings")), SystemClock())
    async with running(child), asyncio.timeout(DEADLINE):
        await asyncio.to_thread(wait_until, "its reason", lambda: "cannot record into" in child.problem)


async def test_without_its_packages_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("fleet.record.child.is_installed", lambda: False)
    child = RecorderChild(RecordTask(str(tmp_path)), SystemClock())
    await child.run()
    assert "zenoh-fleet[record]" in child.problem
