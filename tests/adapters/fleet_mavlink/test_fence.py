"""The fence in the autopilot, on both simulated ones."""

import asyncio
import contextlib

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3, Velocity
from fleet.model.health import Level
from fleet.robot_config import FenceConfig, Limits
from fleet_mavlink.fence import items_of, parameters_of
from fleet_mavlink.world_frame import GeoOrigin

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
YARD = [[-30, -30], [30, -30], [30, 30], [-30, 30]]
POND = [[10, -5], [20, -5], [20, 5], [10, 5]]
FENCE = {"inclusion": [YARD], "exclusion": [POND]}
SWITCH = {"ardupilot": "FENCE_ENABLE", "px4": "GF_ACTION"}


def corners(it):
    """Return the stored corners as (command, corners of its polygon)."""
    return [(item.command, item.p1) for item in it.sim.pilot.missions.plan(1)]


def is_well(it):
    """Return whether it was last told to be well."""
    return bool(it.robot.healths) and it.robot.healths[-1].level is Level.OK


@both
def test_it_is_brought_there_read_back_and_switched_on(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, fence=FENCE, limits={"altitude": 40.0, "distance": 60.0}) as it:
            await it.until(lambda: is_well(it), within=30.0)
            assert corners(it) == [(5001, 4.0)] * 4 + [(5002, 4.0)] * 4
            params = it.sim.pilot.params
            assert params[SWITCH[flavour]] == {"ardupilot": 1, "px4": 3}[flavour]
            height = params["FENCE_ALT_MAX" if flavour == "ardupilot" else "GF_MAX_VER_DIST"]
            assert height == 42.0
            causes = [health.cause for health in it.robot.healths]
            assert "the fence is not in the autopilot yet" in causes

    run_in_sim_time(main())


@both
def test_the_autopilot_keeps_it_without_the_edge(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, fence=FENCE) as it:
            await it.until(lambda: is_well(it), within=30.0)
            await it.do("takeoff", altitude=10.0)
            with contextlib.suppress(NotReady):
                await it.drive(Velocity(Vector3(3.0, 0.0, 0.0)), 20.0)
            await it.until(lambda: it.mode == "RTL", within=5.0)
            await it.until(lambda: it.robot.losses, within=5.0)
            assert "its own fail-safe" in it.robot.losses[0]

    run_in_sim_time(main())


@both
def test_it_is_not_changed_in_flight_and_that_is_reported(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, fence=FENCE) as it:
            await it.until(lambda: is_well(it), within=30.0)
            await it.do("takeoff", altitude=5.0)
            it.sim.pilot.missions._plans.pop(1)  # as if another station had cleared it
            fence = it.adapter._session.fence
            keeping = asyncio.ensure_future(fence.run())
            await it.until(lambda: "not changed in flight" in str(fence.troubles), within=20.0)
            assert corners(it) == []
            await it.do("land")
            await it.until(lambda: len(corners(it)) == 8 and not fence.troubles, within=20.0)
            keeping.cancel()

    run_in_sim_time(main())


@both
def test_a_limit_that_a_float_rounds_is_not_taken_for_another_fence(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, fence=FENCE, limits={"altitude": 39.7}) as it:
            await it.until(lambda: is_well(it), within=30.0)
            await it.do("takeoff", altitude=5.0)
            fence = it.adapter._session.fence
            fence.troubles = ()
            keeping = asyncio.ensure_future(fence.run())
            await asyncio.sleep(10.0)
            assert fence.troubles == ()
            keeping.cancel()

    run_in_sim_time(main())


def test_ardupilot_refuses_a_goal_outside_even_if_nobody_else_does(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", fence=FENCE) as it:
            await it.until(lambda: is_well(it), within=30.0)
            await it.do("takeoff", altitude=10.0)
            outside = GoTo(Goal(position=Vector3(15.0, 0.0, 10.0)))
            with pytest.raises(Refused):
                await anext(aiter(it.adapter.navigate(outside)))
            assert it.mode in {"GUIDED", "BRAKE"}

    run_in_sim_time(main())


def test_corners_in_metres_are_placed_around_the_origin():
    items = items_of(FenceConfig(inclusion=[YARD]), GeoOrigin(47.0, 8.0))
    assert {round((item.x / 1e7 - 47.0) * 111_200) for item in items} == {-30, 30}


def test_without_limits_no_height_or_distance_is_watched():
    wanted = parameters_of("ardupilot", FenceConfig(inclusion=[YARD]), Limits())
    assert wanted["FENCE_TYPE"] == 4
    assert "FENCE_ALT_MAX" not in wanted
