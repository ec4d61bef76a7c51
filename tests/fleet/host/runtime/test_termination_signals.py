"""What ends a process that has robots."""

import asyncio
import os
import signal

import pytest

from fleet.host.runtime.termination_signals import end_by_signal

ALL = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


@pytest.fixture
async def hang_up():
    """Have the end of its terminal end this process, also where the tests were begun under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    for number in ALL:
        asyncio.get_running_loop().remove_signal_handler(number)
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
async def test_a_signal_ends_it_in_order(number, hang_up):
    ended = asyncio.Event()
    end_by_signal(ended.set)
    os.kill(os.getpid(), number)
    await asyncio.wait_for(ended.wait(), 10)


async def test_ctrl_z_does_not_leave_robots_without_their_host(hang_up, requests, caplog):
    ended = asyncio.Event()
    end_by_signal(ended.set)
    os.kill(os.getpid(), signal.SIGTSTP)
    await requests.until(lambda: "not suspended" in caplog.text)
    assert not ended.is_set()


async def test_under_nohup_it_goes_on_when_the_terminal_is_closed(hang_up):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    end_by_signal(asyncio.Event().set)
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
