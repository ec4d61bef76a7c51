"""Ends a test that hangs, with its name.

The signal of pytest-timeout ends what waits in Python code. In an event loop of uvloop it does nothing: its
exception is raised in a callback of the loop, which logs it. So a thread watches each test, too: it cancels
what the test awaits, so that it fails where it hangs and its fixtures end what they started. When that does
not help either, it ends the process; pytest-xdist then reports the test as failed, and goes on in a new one.
"""

import asyncio
import gc
import inspect
import sys
import threading

import pytest
import pytest_timeout

AFTER_SIGNAL = 1.0  # s
AFTER_CANCEL = 30.0  # s for the test's fixtures to end what they started
ENDED = pytest.StashKey[threading.Event]()


@pytest.hookimpl(wrapper=True)
def pytest_timeout_set_timer(item, settings):
    """Watch a test that has a time limit."""
    item.stash[ENDED] = ended = threading.Event()
    threading.Thread(target=_watch, args=(item, settings, ended), name="hangs", daemon=True).start()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    """Watch until the fixtures have ended, too; pytest-timeout ends at the first failure."""
    try:
        return (yield)
    finally:
        if ended := item.stash.get(ENDED, None):
            ended.set()


def _watch(item, settings, ended):
    """Thread: end the test when its time is over."""
    if ended.wait(settings.timeout + AFTER_SIGNAL) or pytest_timeout.is_debugging():
        return
    sys.__stderr__.write(f"\n{item.nodeid} takes more than {settings.timeout:g} s\n")
    loops = [each for each in gc.get_objects() if issubclass(type(each), asyncio.AbstractEventLoop)]
    for loop in [each for each in loops if each.is_running()]:
        loop.call_soon_threadsafe(_cancel, loop, item, f"it takes more than {settings.timeout:g} s")
    if not ended.wait(AFTER_CANCEL):
        pytest_timeout.timeout_timer(item, settings)


def _cancel(loop, item, why):
    """Cancel what a test awaits; while it awaits nothing, a fixture hangs, and all tasks are cancelled."""
    code = inspect.unwrap(item.obj).__code__
    tasks = asyncio.all_tasks(loop)
    of_test = [task for task in tasks if getattr(task.get_coro(), "cr_code", None) is code]
    for task in of_test or tasks:
        task.cancel(why)
