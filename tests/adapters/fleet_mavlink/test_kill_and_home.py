"""The command that lets it fall, and home by place."""

import asyncio

import pytest

from fleet import Refused, Vector3, Velocity
from fleet.errors import CommandError

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


@both
def test_kill_needs_the_config_and_force(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            with pytest.raises(Refused, match="not allowed"):
                await it.do("kill", force=True)
        async with sim_flight(flavour, allow_kill=True) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            with pytest.raises(Refused, match="force"):
                await it.do("kill")
            assert it.armed

    run_in_sim_time(main())


@both
def test_a_killed_vehicle_falls_and_is_left_alone(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, allow_kill=True) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            began = it.now
            await it.do("kill", force=True)
            assert not it.armed
            assert it.now - began < 1.5
            sent = len(it.setpoints)
            await it.until(lambda: it.height == 0.0, within=5.0)
            await asyncio.sleep(2.0)
            assert len(it.setpoints) == sent

    run_in_sim_time(main())


@both
def test_kill_waits_for_nothing_that_is_under_way(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, allow_kill=True) as it:
            await it.wait_until_known()
            climbing = asyncio.ensure_future(it.do("takeoff", altitude=20.0))
            await it.until(lambda: it.height > 3.0)
            began = it.now
            await it.do("kill", force=True)
            assert it.now - began < 1.5
            with pytest.raises(CommandError, match=r"motors stopped|superseded"):
                await climbing

    run_in_sim_time(main())


@both
def test_home_is_set_to_a_place_and_seen_there(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("set_home_location", latitude=47.398, longitude=8.546, altitude=490.0)
            assert it.sim.pilot.home.place == pytest.approx((47.398, 8.546, 490.0), abs=1e-4)
            assert it.state.home.altitude == pytest.approx(490.0)

    run_in_sim_time(main())


@both
def test_in_the_air_home_keeps_its_altitude(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            before = it.sim.pilot.home.place[2]
            with pytest.raises(Refused, match="keeps its altitude"):
                await it.do("set_home_location", latitude=47.398, longitude=8.546, altitude=500.0)
            await it.do("set_home_location", latitude=47.398, longitude=8.546)
            assert it.sim.pilot.home.place == pytest.approx((47.398, 8.546, before), abs=0.2)

    run_in_sim_time(main())


@pytest.mark.parametrize(
    "place",
    [
        {"latitude": 91.0, "longitude": 0.0},
        {"latitude": 47.0, "longitude": 181.0},
        {"latitude": float("nan"), "longitude": 8.0},
        {"latitude": 47.0, "longitude": 8.0, "altitude": 1e6},
    ],
)
def test_a_home_that_is_no_place_is_refused(run_in_sim_time, sim_flight, place):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            with pytest.raises(Refused):
                await it.do("set_home_location", **place)

    run_in_sim_time(main())
