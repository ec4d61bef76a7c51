"""Running in the foreground: what ends it."""

import asyncio
import os
import signal

import pytest

from fleet.cli.serve import end_by_signal


@pytest.fixture
def hang_up():
    """Have the end of its terminal end this process, also where the tests were begun under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
async def test_a_signal_ends_it_in_order(number, hang_up, capsys):
    ended = asyncio.Event()
    end_by_signal(ended)
    os.kill(os.getpid(), number)
    await asyncio.wait_for(ended.wait(), 10)
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().remove_signal_handler(each)
    assert "brought to a standstill" in capsys.readouterr().err


async def test_under_nohup_it_goes_on_when_the_terminal_is_closed(hang_up):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    end_by_signal(asyncio.Event())
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    for each in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().remove_signal_handler(each)
