"""A call that is made at most once in an interval."""

import asyncio

import pytest

from fleet.cloud.spaced_call import SpacedCall
from fleet.testing.clock import ManualClock

SPACING = 0.002  # s
WITHIN = 60.0  # s


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
async def spaced(clock):
    return SpacedCall(asyncio.get_running_loop(), clock, SPACING)


@pytest.fixture
async def made():
    return asyncio.Queue()


async def test_the_first_call_is_made_at_once_and_so_is_one_after_the_interval(spaced, made, clock):
    spaced(lambda: made.put_nowait("first"))
    spaced.mark(clock.monotonic())
    clock.advance(SPACING)
    spaced(lambda: made.put_nowait("second"))
    assert [made.get_nowait(), made.get_nowait()] == ["first", "second"]
    assert not spaced.planned


async def test_calls_within_the_interval_are_made_once_at_its_end(spaced, made, clock):
    spaced.mark(clock.monotonic())
    for _ in range(3):
        spaced(lambda: made.put_nowait(spaced.planned))
    assert spaced.planned
    assert made.empty()
    assert await asyncio.wait_for(made.get(), WITHIN) is False, "the mark falls before the call"
    assert made.empty()
