"""Missions from the autopilot's own memory, flown by both simulated autopilots."""

import asyncio
import contextlib

import msgspec
import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import FlyMission, GeoOrigin, GeoPoint, NotReady, Refused, TimedOut, Vector3
from fleet.model.geodesy import geo_from_world
from fleet.model.navigation import Constraints, PlanItem
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.mission import plan_of
from fleet_mavlink.plans import PlanType
from fleet_mavlink.sim.ardupilot_modes import MODES as ARDUPILOT_MODES
from fleet_mavlink.sim.px4_modes import MODES as PX4_MODES

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOME = GeoOrigin(47.397742, 8.545594, 488.0)
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
MODES = {"ardupilot": ARDUPILOT_MODES, "px4": PX4_MODES}
AUTO = {"ardupilot": "AUTO", "px4": "MISSION"}


def at(east, north, height=10.0):
    """Return a place by metres from home, its altitude above home."""
    point = geo_from_world(HOME, Vector3(east, north, 0.0))
    return GeoPoint(point.latitude, point.longitude, height)


def mission(*items, **more):
    return FlyMission("survey", items, **more)


SQUARE = mission(
    PlanItem("waypoint", at(0, 15)),
    PlanItem("loiter_time", at(15, 15), seconds=3.0),
    PlanItem("waypoint", at(15, 0, 6.0), speed=2.0, tolerance=1.0),
)
HOMEWARDS = mission(PlanItem("waypoint", at(0, 12)), PlanItem("return_to_launch"))


async def flown(it, task):
    """Fly a task; return its progress."""
    async with contextlib.aclosing(it.adapter.navigate(task)) as steps:
        return [step async for step in steps]


@both
def test_a_mission_is_sent_taken_off_for_and_flown_item_by_item(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            steps = await flown(it, SQUARE)
            reached = [step.reached for step in steps]
            assert reached == sorted(reached)
            assert {0, 1, 2, 3} <= set(reached) | {3}
            assert it.place == pytest.approx((0.0, 15.0, 6.0), abs=1.2)
            await it.until(lambda: it.mode == HOLD[flavour], within=5.0)
            assert it.robot.losses == []

    run_in_sim_time(main())


@both
def test_what_is_still_reported_of_the_last_mission_is_not_taken_for_the_next_ones(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            for turn in range(8):
                east = 5.0 * (turn % 2)
                there = mission(*(PlanItem("waypoint", at(east, 5.0 * each)) for each in range(1, 4)))
                steps = await flown(it, there)
                assert it.place == pytest.approx((15.0, east, 10.0), abs=1.2)
                assert [step.reached for step in steps[:4]] == [0, 0, 0, 0]
                await asyncio.sleep(0.27 * turn)

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("stopped", [True, False])
def test_a_mission_after_an_unfinished_one_is_flown_from_its_first_item(
    run_in_sim_time, sim_flight, flavour, stopped
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            before = mission(*(PlanItem("waypoint", at(0, 8 * each)) for each in range(1, 5)))
            async with contextlib.aclosing(it.adapter.navigate(before)) as steps:
                async for step in steps:
                    if step.reached == 2:
                        break
            if stopped:
                await it.adapter.stop("stop")
            async with contextlib.aclosing(it.adapter.navigate(SQUARE)) as steps:
                places = [(step.reached, it.place) async for step in steps]
            assert it.mode == HOLD[flavour]
            assert next(place for reached, place in places if reached == 1)[1] < 2.0  # not at the second yet
            assert next(place for reached, place in places if reached == 2)[:2] == pytest.approx(
                (15, 15), abs=2
            )

    run_in_sim_time(main())


@both
def test_the_mission_that_is_flown_is_left_before_another_takes_its_place(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            async with contextlib.aclosing(
                it.adapter.navigate(mission(PlanItem("waypoint", at(0, 60))))
            ) as steps:
                async for _ in steps:
                    if it.place[0] > 5.0:
                        break
            modes = []
            upload = it.sim.pilot.missions.upload.count
            it.sim.pilot.missions.upload.count = lambda *said: modes.append(it.mode) or upload(*said)
            await flown(it, SQUARE)
            assert modes == [HOLD[flavour]]

    run_in_sim_time(main())


@both
def test_a_mission_that_ends_at_home_ends_on_the_ground(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await flown(it, HOMEWARDS)
            assert not it.armed
            assert it.place == pytest.approx((0.0, 0.0, 0.0), abs=1.0)
            assert it.robot.losses == []

    run_in_sim_time(main())


@both
def test_a_mission_is_paused_and_goes_on_at_its_item(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            async with contextlib.aclosing(it.adapter.navigate(SQUARE)) as steps:
                async for step in steps:
                    if step.reached == 1:
                        break
            await it.adapter.stop("pause")
            assert it.mode == HOLD[flavour]
            uploads = it.sim.pilot.missions.items
            steps = await flown(it, msgspec.structs.replace(SQUARE, resumed=True))
            assert it.sim.pilot.missions.items is uploads
            assert steps[-1].reached >= 2
            assert it.place == pytest.approx((0.0, 15.0, 6.0), abs=1.2)

    run_in_sim_time(main())


@both
def test_a_mission_that_was_replaced_meanwhile_is_not_gone_on_with(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            async with contextlib.aclosing(it.adapter.navigate(SQUARE)) as steps:
                async for step in steps:
                    if step.reached:
                        break
            await it.adapter.stop("pause")
            await it.adapter._session.plans.clear(PlanType.MISSION)
            with pytest.raises(Refused, match="replaced"):
                await flown(it, msgspec.structs.replace(SQUARE, resumed=True))

    run_in_sim_time(main())


@both
def test_the_speed_of_a_mission_is_kept_and_clamped(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, limits={"speed": 3.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            task = mission(PlanItem("waypoint", at(0, 60), speed=9.0), constraints=Constraints(2.0))
            fastest = 0.0
            async with contextlib.aclosing(it.adapter.navigate(task)) as steps:
                async for _ in steps:
                    fastest = max(fastest, it.sim.body.vn)
            assert 2.5 < fastest < 3.3

    run_in_sim_time(main())


@both
def test_a_pilot_who_takes_over_ends_the_mission(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            flying = asyncio.ensure_future(flown(it, SQUARE))
            await it.until(lambda: it.mode == AUTO[flavour], within=60.0)
            it.sim.set_fault("pilot_takeover", 1.0)
            with pytest.raises(Refused, match=r"taken over|another operator"):
                await flying
            assert it.robot.losses
            assert it.mode in {"LOITER", "POSCTL"}

    run_in_sim_time(main())


@both
def test_a_hold_by_another_station_on_the_last_leg_is_no_end(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            flight = asyncio.ensure_future(flown(it, mission(PlanItem("waypoint", at(0, 100)))))
            await it.until(lambda: it.mode == AUTO[flavour] and it.place[0] > 20.0)
            held = next(each for each in MODES[flavour].values() if each.name == HOLD[flavour])
            it.sim.pilot.pilot_takes_over(held)
            with pytest.raises(Refused):
                await flight
            assert "not by us" in it.robot.losses[0]

    run_in_sim_time(main())


@both
def test_what_is_beyond_the_limits_or_planned_for_elsewhere_is_refused_before_it_is_sent(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, limits={"altitude": 20.0, "distance": 50.0}) as it:
            await it.wait_until_known()
            beyond = (
                mission(PlanItem("waypoint", at(0, 10, 21.0))),
                mission(PlanItem("waypoint", at(0, 60))),
                mission(PlanItem("waypoint", at(0, 10)), home=GeoPoint(48.0, 8.5, 488.0)),
                mission(PlanItem("waypoint", at(0, 10)), home=GeoPoint(HOME.latitude, HOME.longitude, 988.0)),
            )
            for task in beyond:
                with pytest.raises(Refused):
                    await flown(it, task)
            assert it.sim.pilot.missions.items == []
            assert not it.armed

    run_in_sim_time(main())


@both
def test_a_mission_is_forgotten_but_not_while_ardupilot_flies_it(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            flying = asyncio.ensure_future(flown(it, SQUARE))
            await it.until(lambda: it.mode == AUTO[flavour], within=60.0)
            if flavour == "ardupilot":
                with pytest.raises(Refused, match="ERROR"):
                    await it.do("clear_mission")
            flying.cancel()
            await asyncio.gather(flying, return_exceptions=True)
            await it.adapter.stop("cancelled")
            await it.do("clear_mission")
            assert it.sim.pilot.missions.items == []

    run_in_sim_time(main())


def test_an_item_that_the_autopilot_does_not_fly_is_refused_in_its_words(run_in_sim_time, sim_flight):
    async def main():
        turns = mission(PlanItem("loiter_turns", at(0, 15), turns=2, radius=5.0))
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="UNSUPPORTED"):
                await flown(it, turns)
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            await flown(it, turns)

    run_in_sim_time(main())


@both
def test_a_mission_without_an_end_is_there_at_its_last_place(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await flown(it, mission(PlanItem("loiter_unlimited", at(0, 15))))
            assert it.place[0] == pytest.approx(15.0, abs=2.5)

    run_in_sim_time(main())


@pytest.mark.parametrize("loss", [0.15, 0.3])
@both
def test_a_transfer_over_a_lossy_link_arrives_whole(run_in_sim_time, sim_flight, flavour, loss):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.sim.set_fault("loss", loss)
            items = tuple(PlanItem("waypoint", at(0, 10 + each)) for each in range(12))
            plans = it.adapter._session.plans
            plan = plan_of(mission(*items), it.adapter._session.flight.flavour, at(0, 0, 488.0), 5.0)
            await plans.upload(PlanType.MISSION, plan.items)
            it.sim.set_fault("loss", None)
            kept = await plans.download(PlanType.MISSION)
            assert [item.x for item in kept[-12:]] == [item.x for item in plan.items[-12:]]

    run_in_sim_time(main())


def test_a_vehicle_that_says_nothing_ends_the_transfer(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            it.radio = False
            with pytest.raises((TimedOut, NotReady)):
                await it.adapter._session.plans.download(PlanType.MISSION)
            assert it.requested(MavCmd.MISSION_START) == []

    run_in_sim_time(main())


def landing(north, height=40.0):
    """Return a plan to a place and down to home, in circles on the way."""
    return mission(
        PlanItem("waypoint", at(0, north, height)),
        PlanItem("land_start"),
        PlanItem("loiter_to_altitude", at(0, north / 2, 25.0), radius=60.0),
        PlanItem("land", at(0, 0, 0.0)),
    )


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_plane_flies_a_plan_to_its_landing_and_is_seen_on_the_ground(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, vehicle="plane", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: any("AIRSP" in name for name in it.state.settings))
            await it.until(
                lambda: set(it.adapter._session.flight.flavour.settings[1:]) <= set(it.state.settings)
            )
            if flavour == "ardupilot":
                with pytest.raises(Refused, match="RTL_AUTOLAND disabled"):
                    await flown(it, landing(500.0))
                await it.do("set_parameter", name="RTL_AUTOLAND", value=3)
            steps = await flown(it, landing(500.0))
            assert steps[-1].percent >= 75.0
            assert not it.armed
            assert it.height == 0.0
            assert abs(it.place[0]) < 200.0

    run_in_sim_time(main())


def test_the_landing_of_a_plan_goes_on_when_the_edge_ends_and_not_when_it_is_stopped(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot", vehicle="plane", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: "TKOFF_ALT" in it.state.settings)
            await it.do("set_parameter", name="RTL_AUTOLAND", value=3)
            going = asyncio.ensure_future(flown(it, landing(500.0)))
            await it.until(lambda: it.adapter._session.comes_down, 300.0)
            await it.adapter.stop("shutdown")
            assert it.mode == "AUTO"
            await it.adapter.stop("stop")
            assert it.mode == "LOITER"
            with pytest.raises(Refused):
                await going
            assert it.armed

    run_in_sim_time(main())


@both
def test_a_multirotor_lands_where_its_plan_ends(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            plan = PlanItem("waypoint", at(0, 20)), PlanItem("land", at(0, 30, 0.0))
            await flown(it, mission(*plan))
            assert not it.armed
            assert it.place[0] == pytest.approx(30.0, abs=2.0)

    run_in_sim_time(main())


def test_a_landing_that_nothing_leads_to_is_refused(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="must have a place before it"):
                await flown(it, mission(PlanItem("land", at(0, 0, 0.0))))
            assert not it.armed

    run_in_sim_time(main())


@both
def test_a_mission_that_was_paused_before_the_autopilot_had_it_is_sent_when_it_is_resumed(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, faults={"delay": 0.2}) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            starting = asyncio.ensure_future(flown(it, SQUARE))
            await asyncio.sleep(0.7)  # the items are on their way
            starting.cancel()
            await it.adapter.stop("pause")
            await flown(it, msgspec.structs.replace(SQUARE, resumed=True))
            assert it.place == pytest.approx((0.0, 15.0, 6.0), abs=1.2)

    run_in_sim_time(main())


def test_the_end_of_an_upload_that_was_broken_off_is_not_taken_for_the_answer_to_a_download(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight(
            "ardupilot", faults={"delay": 0.2}
        ) as it:  # it gives the upload up after seconds
            await it.wait_until_known()
            await it.do("takeoff")
            starting = asyncio.ensure_future(flown(it, SQUARE))
            await asyncio.sleep(0.7)
            starting.cancel()
            await it.adapter._session.plans.download(PlanType.MISSION)

    run_in_sim_time(main())


@pytest.mark.parametrize("late", [13, 15])  # INVALID_SEQUENCE, OPERATION_CANCELLED
def test_what_is_still_said_of_an_upload_does_not_end_a_download(run_in_sim_time, sim_flight, frame_of, late):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            downloading = asyncio.ensure_future(it.adapter._session.plans.download(PlanType.MISSION))
            it._peer.say(frame_of(mav.MAVLink_mission_ack_message(245, 191, late)))
            await downloading

    run_in_sim_time(main())
