"""How a running edge is ended from its terminal, or by a service manager."""

import asyncio

import pytest

from fleet.cli.output import ExitCode
from fleet.cli.serve import TOGETHER, ServeEnd
from fleet.testing.clock import ManualClock


@pytest.fixture
def requested():
    """Return what takes a signal, its clock, and the exit codes with which it left at once."""
    left, clock, ended = [], ManualClock(), asyncio.Event()
    return ServeEnd(ended, clock.monotonic, left.append), clock, left, ended


async def test_the_first_signal_ends_in_order_and_is_reported_once(requested, capsys):
    ending, _, left, ended = requested
    ending.requested()
    assert (ended.is_set(), left) == (True, [])
    assert capsys.readouterr().err.count("brought to a standstill") == 1


async def test_signals_of_one_request_that_come_together_do_not_cut_the_standstill_short(requested):
    ending, clock, left, _ = requested
    ending.requested()
    clock.advance(TOGETHER / 2)
    ending.requested()
    assert left == []


async def test_a_signal_that_comes_later_leaves_at_once(requested):
    ending, clock, left, _ = requested
    ending.requested()
    clock.advance(TOGETHER * 2)
    ending.requested()
    assert left == [ExitCode.INTERRUPTED]
