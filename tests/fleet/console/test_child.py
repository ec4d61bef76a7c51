"""The console as a child process: started again when it dies, ended with its parent."""

import asyncio
import contextlib
import os
import signal

from fleet.clock import SystemClock
from fleet.console.child import ConsoleChild
from fleet.console.login_links import LinkRequest, answers
from fleet.console.task import ConsoleTask, link_socket
from fleet.model.permission import Permission
from tests.tools.waiting import DEADLINE

REQUESTED = LinkRequest("anna", Permission.ADMIN)


async def started(child, links):
    """Run a child until it serves once more."""
    running = asyncio.create_task(child.run())
    return running, await asyncio.wait_for(links.get(), DEADLINE)


async def test_a_console_that_is_killed_is_started_again_and_ends_with_its_parent(runtime):
    links = asyncio.Queue()
    child = ConsoleChild(
        ConsoleTask("child", 0), runtime, SystemClock(), requested=REQUESTED, served=links.put_nowait
    )
    running, first = await started(child, links)
    process = child.process
    os.kill(process, signal.SIGKILL)
    second = await asyncio.wait_for(links.get(), DEADLINE)
    assert (first != second, child.process != process, child.problem) == (True, True, "")
    running.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await running
    assert not answers(link_socket(runtime, "child"))


async def test_without_its_packages_it_says_what_to_install(runtime, monkeypatch):
    monkeypatch.setattr("fleet.console.child.is_installed", lambda: False)
    child = ConsoleChild(ConsoleTask("bare", 0), runtime, SystemClock())
    await child.run()
    assert "zenoh-fleet[console]" in child.problem
