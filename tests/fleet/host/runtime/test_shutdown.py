"""A process ends though an adapter's thread does not."""

import asyncio
import subprocess
import sys
import threading

from fleet.host.runtime.shutdown import shutdown
from fleet.runtime.event_loop import run

GOES_ON = """
import sys, threading
from fleet.host.runtime import shutdown
shutdown.THREAD_END_TIMEOUT = 0.01
threading.Thread(target=threading.Event().wait, name="pump").start()
sys.exit(shutdown.shutdown(7))
"""


def test_a_thread_that_goes_on_is_named_and_not_waited_for():
    done = subprocess.run([sys.executable, "-c", GOES_ON], check=False, stderr=subprocess.PIPE, timeout=60)
    assert done.returncode == 7
    assert b"left without waiting for pump" in done.stderr


def test_a_thread_that_ends_is_waited_for(monkeypatch):
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait, name="slow")
    monkeypatch.setattr("fleet.host.runtime.shutdown.threading.enumerate", lambda: [thread])
    thread.start()
    threading.Timer(0.01, ended.set).start()
    assert shutdown(3) == 3
    assert not thread.is_alive()


def test_the_end_of_a_loop_does_not_wait_for_a_call_that_never_returns():
    goes_on = threading.Event()

    async def work():
        asyncio.get_running_loop().run_in_executor(None, goes_on.wait)
        return 5

    try:
        assert run(work()) == 5
    finally:
        goes_on.set()
