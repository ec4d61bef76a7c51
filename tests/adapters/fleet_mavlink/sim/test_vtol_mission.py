"""Missions of simulated VTOLs: with their rotors down to the ground."""

import asyncio

import msgspec
import pytest

from fleet import FlyMission, GeoOrigin, NotReady, PlanItem, Refused, Vector3
from fleet.model.geodesy import geo_from_world
from fleet_mavlink.sim.spec import ZURICH

ORIGIN = GeoOrigin(ZURICH[0], ZURICH[1])


def place(north, height):
    """Return a place, metres north of and above home."""
    return msgspec.structs.replace(geo_from_world(ORIGIN, Vector3(0.0, north, 0.0)), altitude=height)


PLAN = FlyMission("down", (PlanItem("waypoint", place(400.0, 40.0)), PlanItem("land", place(0.0, 0.0))))


async def flown(it, mission):
    return [step async for step in it.adapter.navigate(mission)]


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_vtol_lands_with_its_rotors_where_its_plan_ends_and_stands_when_it_is_stopped(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.vtol_state and len(it.state.settings) > 2)
            if flavour == "ardupilot":
                await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
                await it.until(lambda: "plan" not in it.robot.lacking)
            going = asyncio.ensure_future(flown(it, PLAN))
            await it.until(
                lambda: it.adapter._session.comes_down and it.state.relative_altitude < 20.0, 300.0
            )
            await it.adapter.stop("shutdown")
            assert it.mode in {"AUTO", "MISSION"}
            await it.adapter.stop("stop")
            assert it.mode in {"GUIDED", "LOITER"}
            with pytest.raises(Refused):
                await going
            assert it.armed
            height = it.height
            await asyncio.sleep(5.0)
            assert it.height == pytest.approx(height, abs=1.0)
            await flown(it, PLAN)
            assert not it.armed
            assert it.height == 0.0
            assert abs(it.place[0]) < 5.0
            assert (await it.do("check_ready"))["ready"], "what AUTO lacks, a take-off puts right"

    run_in_sim_time(main())


def test_a_landing_waits_until_it_has_reported_whether_it_has_rotors(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.vtol_state and len(it.state.settings) > 2)
            vehicle = it.adapter._session.vehicle
            vehicle.state = msgspec.structs.replace(vehicle.state, vtol_state=None)
            with pytest.raises(NotReady, match="whether it lands with rotors"):
                await flown(it, PLAN)

    run_in_sim_time(main())
