"""A gimbal that turns at a rate stops, whatever gets lost."""

import asyncio
import math

import pytest

from fleet import Refused, TimedOut
from fleet_mavlink.constants import MavResult
from fleet_mavlink.gimbal import LEASE, GimbalTurn
from tests.adapters.fleet_mavlink.gimbals import AIM, run_bench

STOP = (None, None, 0.0, 0.0)


@pytest.fixture
def bench(run_answered):
    """Run a test with a gimbal."""
    return lambda test: run_bench(run_answered, test)


def test_a_turn_that_takes_its_time_is_at_a_rate_and_ends_at_the_angles(bench):
    async def test(it):
        it.tells(0.0)
        began = it.it.vehicle.now()
        await it.gimbal.turn(GimbalTurn(-40.0, None, seconds=4.0))
        assert it.aims == [(None, None, -10.0, None), (-40.0, None, None, None)]
        assert it.it.vehicle.now() - began == pytest.approx(4.0, abs=0.2)
        await asyncio.sleep(3.0)
        assert len(it.aims) == 2

    bench(test)


def test_a_rate_lasts_for_its_lease_from_the_last_command(bench):
    async def test(it):
        for _ in range(3):
            await it.gimbal.spin(10.0, -20.0)
            await asyncio.sleep(LEASE / 2)
        assert it.aims == [(None, None, 10.0, -20.0)] * 3
        await asyncio.sleep(LEASE)
        assert it.aims[3:] == [STOP]

    bench(test)


def test_angles_replace_a_rate(bench):
    async def test(it):
        await it.gimbal.spin(10.0, 0.0)
        await it.gimbal.turn(GimbalTurn(0.0, None))
        await asyncio.sleep(3.0)
        assert it.aims[-1] == (0.0, None, None, None)

    bench(test)


@pytest.mark.parametrize("rate", [360.1, -360.1, math.inf, math.nan])
def test_a_rate_beyond_a_turn_a_second_is_refused(bench, rate):
    async def test(it):
        for pitch, yaw in ((rate, 0.0), (0.0, rate)):
            with pytest.raises(Refused, match="a turning speed is within 360 degrees a second"):
                await it.gimbal.spin(pitch, yaw)
        await it.gimbal.spin(360.0, -360.0)
        assert len(it.aims) == 1

    bench(test)


def test_a_rate_of_which_nothing_is_known_ends_too(bench):
    """The gimbal may turn at it, and at the rate before it, whose end it replaced."""

    async def test(it):
        await it.gimbal.spin(10.0, 0.0)
        it.autopilot.deaf.add(AIM)
        with pytest.raises(TimedOut):
            await it.gimbal.spin(20.0, 0.0)
        it.autopilot.deaf.clear()
        await asyncio.sleep(LEASE + 0.5)
        assert it.aims[-1] == STOP

    bench(test)


@pytest.mark.parametrize("seconds", [1.0, 30.0])
def test_a_slow_turn_that_is_cancelled_does_not_turn_on(bench, seconds):
    async def test(it):
        it.tells(0.0)
        turning = asyncio.ensure_future(it.gimbal.turn(GimbalTurn(-80.0, None, seconds=30.0)))
        await asyncio.sleep(seconds / 2)
        turning.cancel()
        await asyncio.sleep(LEASE + 0.5)
        assert it.aims[-1] == STOP

    bench(test)


def test_an_end_that_is_not_acknowledged_is_told_and_breaks_nothing(bench, caplog):
    async def test(it):
        await it.gimbal.spin(10.0, 0.0)
        it.autopilot.results[AIM] = MavResult.DENIED
        await asyncio.sleep(LEASE + 2.0)
        (ending,) = it.tasks
        assert ending.exception() is None

    bench(test)
    assert "the gimbal may still turn" in caplog.text


def test_angles_that_are_acknowledged_late_are_not_stopped_on_the_way(bench):
    async def test(it):
        it.tells(0.0)
        turning = asyncio.ensure_future(it.gimbal.turn(GimbalTurn(-40.0, None, seconds=2.0)))
        await asyncio.sleep(1.0)
        it.autopilot.deaf.add(AIM)
        await asyncio.sleep(2.8)  # the end of the rate is due meanwhile
        it.autopilot.deaf.clear()
        await turning
        await asyncio.sleep(3.0)
        assert it.aims[-1] == (-40.0, None, None, None)
        assert STOP not in it.aims

    bench(test)
