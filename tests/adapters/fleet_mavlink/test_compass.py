"""Calibrating the compass on both autopilots."""

import asyncio

import pytest

from fleet import Refused, TimedOut
from fleet.errors import CommandError

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


@both
def test_a_calibration_is_followed_to_its_end(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            percents = await it.do("start_compass_calibration")
            assert percents == sorted(percents)
            assert percents[0] == 0.0
            assert percents[-1] == 100.0
            assert len(percents) > 10

    run_in_sim_time(main())


@both
def test_a_calibration_that_fails_is_reported(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, faults={"compass_fails": 1.0}) as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="calibration failed"):
                await it.do("start_compass_calibration")

    run_in_sim_time(main())


@both
def test_a_calibration_can_be_stopped(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            running = asyncio.ensure_future(it.do("start_compass_calibration"))
            await it.until(lambda: it.sim.equipment.compass.calibrating)
            await it.do("stop_compass_calibration")
            with pytest.raises(Refused, match=r"stopped|cancelled"):
                await running
            assert not it.sim.equipment.compass.calibrating

    run_in_sim_time(main())


@both
def test_a_calibration_that_is_left_is_stopped_on_the_vehicle(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            running = asyncio.ensure_future(it.do("start_compass_calibration"))
            await it.until(lambda: it.sim.equipment.compass.calibrating)
            running.cancel()
            await it.until(lambda: not it.sim.equipment.compass.calibrating, within=5.0)

    run_in_sim_time(main())


@both
def test_a_start_that_is_not_acknowledged_is_stopped_on_the_vehicle(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.sim.faults["ack_loss"] = 1.0
            running = asyncio.ensure_future(it.do("start_compass_calibration"))
            await it.until(lambda: it.sim.equipment.compass.calibrating)
            with pytest.raises(TimedOut):
                await running
            assert not it.sim.equipment.compass.calibrating

    run_in_sim_time(main())


@both
def test_nothing_is_calibrated_in_the_air(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            for name in ("start_compass_calibration", "stop_compass_calibration"):
                with pytest.raises(Refused, match="armed"):
                    await it.do(name)

    run_in_sim_time(main())


def test_a_vehicle_that_falls_silent_ends_it(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            running = asyncio.ensure_future(it.do("start_compass_calibration"))
            await it.until(lambda: it.sim.equipment.compass.calibrating)
            it.sim.equipment.compass.tick = lambda *_, **__: []
            with pytest.raises((TimedOut, CommandError), match="no progress"):
                await running

    run_in_sim_time(main())
