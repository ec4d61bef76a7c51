"""The gimbal: who has control of it, the angles that it is sent, and those that are refused before."""

import asyncio
import math

import pytest

from fleet import FleetError, NotReady, Refused, TimedOut, Unsupported
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.gimbal import GimbalTurn
from fleet_mavlink.messages import SystemTime
from tests.adapters.fleet_mavlink.gimbals import AIM, run_bench

CONFIGURE = MavCmd.DO_GIMBAL_MANAGER_CONFIGURE


@pytest.fixture
def bench(run_answered):
    """Run a test with a gimbal."""
    return lambda test: run_bench(run_answered, test)


def test_control_is_taken_for_this_edge_once_and_again_after_a_restart(bench):
    async def test(it):
        await it.gimbal.turn(GimbalTurn(-10.0, None))
        await it.gimbal.turn(GimbalTurn(-20.0, None))
        (taken,) = it.commands(CONFIGURE)
        assert (taken.param1, taken.param2, taken.param3, taken.param4) == (245.0, 191.0, -1.0, -1.0)
        it.it.receive(SystemTime(60_000))
        it.it.receive(SystemTime(500))
        await it.gimbal.turn(GimbalTurn(-10.0, None))
        assert len(it.commands(CONFIGURE)) == 2

    bench(test)


def test_an_axis_that_is_not_named_stays_and_the_horizon_is_kept(bench):
    async def test(it):
        await it.gimbal.turn(GimbalTurn(-10.0, None))
        await it.gimbal.turn(GimbalTurn(None, 20.0))
        assert it.aims == [(-10.0, None, None, None), (None, 20.0, None, None)]
        assert {each.param5 for each in it.commands(AIM)} == {12.0}

    bench(test)


@pytest.mark.parametrize(
    ("turn", "sent"),
    [
        (GimbalTurn(-10.0, 5.0, relative=True), (-40.0, 25.0, None, None)),
        (GimbalTurn(None, -30.0, relative=True), (None, -10.0, None, None)),
        (GimbalTurn(-10.0, 5.0), (-10.0, 5.0, None, None)),
    ],
)
def test_relative_angles_are_from_where_it_is_seen(bench, turn, sent):
    async def test(it):
        it.tells(-30.0, 20.0)
        turning = asyncio.ensure_future(it.gimbal.turn(turn))
        await asyncio.sleep(1.0)
        assert it.aims == [tuple(each if each is None else pytest.approx(each, abs=1e-6) for each in sent)]
        turning.cancel()

    bench(test)


@pytest.mark.parametrize("turn", [GimbalTurn(5.0, None, relative=True), GimbalTurn(5.0, None, seconds=2.0)])
def test_what_needs_to_know_how_it_is_turned_is_refused_while_it_does_not_say(bench, turn):
    async def test(it):
        with pytest.raises(NotReady, match="the gimbal does not say how it is turned"):
            await it.gimbal.turn(turn)
        assert it.aims == []

    bench(test)


@pytest.mark.parametrize(
    ("pitch", "yaw", "why"),
    [
        (-90.6, None, "pitch -90.6 is not within the gimbal's -90 to 30 degrees"),
        (30.6, None, "pitch 30.6 is not within"),
        (None, 161.0, "yaw 161 is not within the gimbal's -160 to 160 degrees"),
        (math.nan, None, "pitch must be degrees within a turn"),
        (None, 361.0, "yaw must be degrees within a turn"),
    ],
)
def test_an_angle_beyond_the_gimbals_is_refused(bench, pitch, yaw, why):
    async def test(it):
        with pytest.raises(Refused) as refused:
            await it.gimbal.turn(GimbalTurn(pitch, yaw))
        assert why in refused.value.reason
        assert it.aims == []

    bench(test)


def test_half_a_degree_beyond_a_limit_is_the_limit_and_unreported_limits_are_none(bench):
    async def test(it):
        await it.gimbal.turn(GimbalTurn(-90.5, 160.5))
        it.gimbal._manager = None
        it.autopilot.limits = (0.0, 0.0, 0.0, 0.0)
        await it.gimbal.turn(GimbalTurn(-120.0, 350.0))
        assert len(it.aims) == 2

    bench(test)


def test_a_turn_is_done_when_it_is_seen_and_fails_when_it_is_not(bench):
    async def test(it):
        it.tells(0.0)
        await it.gimbal.turn(GimbalTurn(-45.0, None))
        it.autopilot.obeys = False
        began = it.it.vehicle.now()
        with pytest.raises(TimedOut, match="took the command but does not turn there"):
            await it.gimbal.turn(GimbalTurn(0.0, None))
        assert it.it.vehicle.now() - began == pytest.approx(15.0, abs=0.2)
        await it.gimbal.turn(GimbalTurn(-42.1, None))  # within 3 degrees

    bench(test)


def test_control_that_another_station_took_is_taken_back_by_the_next_command(bench):
    async def test(it):
        await it.gimbal.turn(GimbalTurn(0.0, None))
        it.autopilot.results[AIM] = MavResult.DENIED
        with pytest.raises(FleetError):
            await it.gimbal.turn(GimbalTurn(5.0, None))
        it.autopilot.results.clear()
        await it.gimbal.turn(GimbalTurn(5.0, None))
        assert len(it.commands(CONFIGURE)) == 2

    bench(test)


@pytest.mark.parametrize("result", [MavResult.UNSUPPORTED, MavResult.DENIED, MavResult.FAILED])
def test_an_autopilot_that_refuses_to_tell_of_a_gimbal_has_none(bench, result):
    async def test(it):
        it.autopilot.results[MavCmd.REQUEST_MESSAGE] = result
        with pytest.raises(Unsupported, match="the autopilot has no gimbal"):
            await it.gimbal.spin(1.0, 0.0)

    bench(test)


def test_one_that_promises_to_tell_and_does_not_has_none_either_and_silence_is_no_answer(bench):
    async def test(it):
        it.autopilot.limits = None
        with pytest.raises(Unsupported, match="reports no gimbal"):
            await it.gimbal.turn(GimbalTurn(0.0, None))
        it.autopilot.deaf.add(MavCmd.REQUEST_MESSAGE)
        with pytest.raises(TimedOut):
            await it.gimbal.turn(GimbalTurn(0.0, None))

    bench(test)


def test_a_silent_vehicle_is_not_asked(bench):
    async def test(it):
        it.it.silent = True
        await asyncio.sleep(5.0)
        with pytest.raises(NotReady, match="no heartbeat from system 1"):
            await it.gimbal.turn(GimbalTurn(0.0, None))
        assert it.it.sent == []

    bench(test)
