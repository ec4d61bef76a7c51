"""Planes: the list that real ones are flown through, flown by the simulated ones."""

import asyncio
import math

import pytest

from fleet import FlyMission, FollowPath, GeoOrigin, Goal, GoTo, NotReady, PlanItem, Refused, Vector3
from fleet.model.geodesy import geo_from_world
from fleet.model.navigation import Constraints
from fleet_mavlink.px4_plane import Px4Plane
from fleet_mavlink.state import VehicleState


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_planes_fly_the_list(run_in_sim_time, sim_flight, module_at, flavour):
    lines = []

    async def main():
        async with sim_flight(flavour, vehicle="plane", limits={"speed": 30.0}) as it:
            await module_at("sitl/plane_list.py").fly(it, lines.append)

    run_in_sim_time(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/plane_list.py").STEPS)


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_vtols_fly_the_list(run_in_sim_time, sim_flight, module_at, flavour):
    lines = []

    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            planes = module_at("sitl/plane_list.py")
            await module_at("sitl/vtol_list.py").fly(it, planes, lines.append)

    run_in_sim_time(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/vtol_list.py").STEPS)


CONFIGURED = VehicleState(settings={"FW_AIRSPD_MIN": 10.0, "FW_AIRSPD_TRIM": 15.0, "FW_AIRSPD_MAX": 20.0})


@pytest.mark.parametrize(
    ("limit", "wanted", "airspeed"),
    [(30.0, None, 15.0), (12.0, None, 12.0), (30.0, 18.0, 18.0), (30.0, 99.0, 20.0), (None, 12.0, 12.0)],
)
def test_a_goal_is_flown_at_what_is_asked_for_within_the_limit_and_the_fastest(limit, wanted, airspeed):
    assert Px4Plane().airspeed(CONFIGURED, limit, wanted) == airspeed


def test_an_airspeed_under_the_slowest_is_refused_with_whose_it_is():
    with pytest.raises(Refused, match="its limit is 5 m/s"):
        Px4Plane().airspeed(CONFIGURED, 5.0, None)
    with pytest.raises(Refused, match="it was asked for 4 m/s"):
        Px4Plane().airspeed(CONFIGURED, 30.0, 4.0)
    with pytest.raises(NotReady, match="not known yet"):
        Px4Plane().airspeed(VehicleState(), 30.0, None)


def test_a_plane_does_not_take_off_under_the_limit_of_a_multirotor(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", vehicle="plane") as it:
            await it.wait_until_known()
            await it.until(lambda: "FW_AIRSPD_MIN" in it.state.settings)
            with pytest.raises(Refused, match=r"its limit is 5 m/s"):
                await it.do("takeoff", altitude=30.0)
            assert not it.armed

    run_in_sim_time(main())


def test_a_halted_plane_is_sent_into_its_circle_and_no_velocity(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="plane", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: "TKOFF_ALT" in it.state.settings)
            await it.do("takeoff", altitude=40.0)
            it.adapter.halt()
            await it.until(lambda: it.mode == "LOITER", 10.0)
            assert it.setpoints == []

    run_in_sim_time(main())


def test_a_quadplane_as_it_is_delivered_lands_when_it_is_stopped_in_its_hover(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: "Q_GUIDED_MODE" in it.state.settings)
            await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
            await it.until(lambda: "takeoff" not in it.robot.lacking)
            await it.do("takeoff", altitude=20.0)
            await it.do("set_parameter", name="Q_GUIDED_MODE", value=0, force=True)
            await it.adapter.stop("emergency_stop")
            assert it.mode == "QLAND"

    run_in_sim_time(main())


async def hovering(it, **settings):
    """Meet a QuadPlane, set it up, and take it to 40 m."""
    await it.wait_until_known()
    await it.until(
        lambda: {"Q_GUIDED_MODE", "Q_WP_SPEED", "Q_TRANS_DECEL", "Q_ASSIST_SPEED"} <= set(it.state.settings)
    )
    for name, value in {"Q_GUIDED_MODE": 1, **settings}.items():
        await it.do("set_parameter", name=name, value=value)
    await it.until(lambda: "takeoff" not in it.robot.lacking)
    await it.do("takeoff", altitude=40.0)


async def flown(it, task):
    """Fly a task; return how fast it was seen to fly at most."""
    going = asyncio.ensure_future(exhausted(it.adapter.navigate(task)))
    fastest = 0.0
    while not going.done():
        fastest = max(fastest, math.hypot(it.sim.body.vn, it.sim.body.ve))
        await asyncio.sleep(0.1)
    await going
    return fastest


async def exhausted(steps):
    return [step async for step in steps]


def goal(north, speed=None):
    constraints = Constraints(max_speed=speed)
    return GoTo(Goal(position=Vector3(0.0, north, 40.0)), constraints=constraints)


def test_a_quadplane_flies_to_a_far_goal_at_the_airspeed_that_is_asked_for_or_the_limit(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 17.0}) as it:
            await hovering(it)
            assert 15.0 < await flown(it, goal(900.0)) < 17.5
            assert 11.0 < await flown(it, goal(-900.0, speed=13.0)) < 15.5, "15 m/s at a transition's end"

    run_in_sim_time(main())


def test_a_quadplane_takes_no_far_goal_that_is_slower_than_its_wings_fly(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 6.0}) as it:
            await hovering(it)
            with pytest.raises(Refused, match="a goal more than 163 m away is flown on its wings: its limit"):
                await flown(it, goal(900.0))
            near = GoTo(Goal(position=Vector3(0.0, 100.0, 40.0)))
            assert await flown(it, near) < 5.5
            with pytest.raises(Refused, match=r"flies at 5 m/s \(Q_WP_SPEED\), and it may fly at 3 m/s"):
                await flown(it, goal(0.0, speed=3.0))
            path = FollowPath(
                (Goal(position=Vector3(0.0, 0.0, 40.0)), Goal(position=Vector3(0.0, 900.0, 40.0)))
            )
            with pytest.raises(Refused, match="flown on its wings"):
                await flown(it, path)

    run_in_sim_time(main())


@pytest.mark.parametrize("last", ["waypoint", "loiter_unlimited"])
def test_a_quadplane_ends_a_mission_at_its_last_place_and_flies_it_within_its_limit(
    run_in_sim_time, sim_flight, last
):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 17.0}) as it:
            await hovering(it)
            home = it.state.home
            there = geo_from_world(GeoOrigin(home.latitude, home.longitude), Vector3(0.0, 400.0, 40.0))
            beyond = geo_from_world(GeoOrigin(home.latitude, home.longitude), Vector3(300.0, 600.0, 40.0))
            items = PlanItem("waypoint", there), PlanItem(last, beyond)
            assert await flown(it, FlyMission("out", items)) < 17.5
            assert it.sim.pilot.params["MIN_GROUNDSPEED"] == 0.0
            assert it.mode in {"LOITER", "GUIDED"}

    run_in_sim_time(main())


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_plane_tells_how_wide_it_circles_and_a_vtol_while_it_is_on_its_wings(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, vehicle="plane", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.circle == 95.0, 60.0)
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            if flavour == "ardupilot":
                await hovering(it)
            else:
                await it.wait_until_known()
                await it.until(lambda: "FW_AIRSPD_MIN" in it.state.settings)
                await it.do("takeoff", altitude=40.0)
            assert it.robot.circle == 0.0
            await it.do("transition", to="forward")
            await it.until(lambda: it.robot.circle == 95.0, 3.0)

    run_in_sim_time(main())


def test_a_quadplane_takes_no_far_goal_at_an_airspeed_at_which_its_rotors_help(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 17.0}) as it:
            await hovering(it, Q_ASSIST_SPEED=13)
            await it.until(lambda: it.state.settings["Q_ASSIST_SPEED"] == 13.0)
            with pytest.raises(Refused, match=r"at 14 m/s its rotors help \(Q_ASSIST_SPEED 13\)"):
                await flown(it, goal(900.0, speed=14.0))
            assert await flown(it, goal(900.0)) < 17.5

    run_in_sim_time(main())
