"""A rover on ArduPilot: driven, sent to places, stopped; what it cannot do is refused with words."""

import asyncio
import math

import msgspec
import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import (
    FlyMission,
    FollowPath,
    GeoOrigin,
    GeoPoint,
    Goal,
    GoTo,
    NotReady,
    PlanItem,
    Refused,
    RelativeMove,
    Unsupported,
    Vector3,
    Velocity,
)
from fleet.errors import CommandError
from fleet.model.geodesy import geo_from_world
from fleet.model.health import Level
from fleet.model.navigation import Constraints
from fleet_mavlink.ardupilot_rover import ArduRover

HOME = GeoOrigin(47.397742, 8.545594, 488.0)
NEAR = 1.5  # m, as it says of itself
BACK = Velocity(Vector3(-1.0, 0.0, 0.0))


def ahead(speed=2.0, turn=0.0):
    return Velocity(Vector3(speed, 0.0, 0.0), turn)


def at(east, north):
    """Return a place by metres from home."""
    point = geo_from_world(HOME, Vector3(east, north, 0.0))
    return GeoPoint(point.latitude, point.longitude, 0.0)


def to(east, north, **more):
    return Goal(position=Vector3(float(east), float(north), 0.0), **more)


async def exhausted(steps):
    return [step async for step in steps]


async def armed(it):
    await it.wait_until_known()
    await it.do("arm")
    return it


def along(it):
    """Return metres that it has gone along the nose that it began with, north."""
    return it.sim.body.north


def driven(run_in_sim_time, sim_flight, drive, **config):
    """Let an armed rover do something."""

    async def main():
        async with sim_flight("ardupilot", vehicle="rover", **config) as it:
            await armed(it)
            await drive(it)

    run_in_sim_time(main())


def test_it_is_driven_ahead_and_keeps_its_heading(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(), 4.0)
        assert it.mode == "GUIDED"
        assert it.sim.body.along == pytest.approx(2.0, abs=0.5)
        assert abs(math.remainder(it.sim.body.heading, math.tau)) < 0.05
        assert it.robot.healths[-1].level is Level.OK

    driven(run_in_sim_time, sim_flight, drive)


def test_it_turns_while_it_drives_to_the_left_for_a_positive_rate(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(turn=0.4), 3.0)
        assert it.sim.body.turn_rate == pytest.approx(-0.4, abs=0.05)

    driven(run_in_sim_time, sim_flight, drive)


@pytest.mark.parametrize("heading", [0, 90, 180, 270])
def test_it_is_driven_backwards_whatever_its_heading_is(run_in_sim_time, sim_flight, heading):
    async def drive(it):
        it.sim.body.heading = math.radians(heading)
        await asyncio.sleep(0.3)
        north, east = it.sim.body.north, it.sim.body.east
        await it.drive(BACK, 4.0)
        gone = Vector3(it.sim.body.north - north, it.sim.body.east - east, 0.0)
        assert gone.x * math.cos(math.radians(heading)) + gone.y * math.sin(math.radians(heading)) < -2.0
        assert abs(math.remainder(it.sim.body.heading - math.radians(heading), math.tau)) < 0.1

    driven(run_in_sim_time, sim_flight, drive)


def test_it_is_not_driven_before_it_is_armed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            with pytest.raises(NotReady, match=r"not armed \(send arm first\)"):
                it.adapter.drive(ahead())
            with pytest.raises(NotReady, match="not armed"):
                await exhausted(it.adapter.navigate(GoTo(to(5, 5))))
            assert it.setpoints == []

    run_in_sim_time(main())


@pytest.mark.parametrize(
    ("velocity", "words"),
    [
        (Velocity(Vector3(0.0, 1.0, 0.0)), "along its nose only, not sideways"),
        (Velocity(Vector3(1.0, 0.0, 0.5)), "moves on the surface"),
    ],
)
def test_what_is_not_along_its_nose_is_refused_and_not_sent(run_in_sim_time, sim_flight, velocity, words):
    async def drive(it):
        with pytest.raises(Unsupported, match=words):
            it.adapter.drive(velocity)
        assert it.setpoints == []

    driven(run_in_sim_time, sim_flight, drive)


def test_it_brakes_when_it_is_no_longer_driven_and_is_left_in_hold(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(), 3.0)
        await it.adapter.stop("stop")
        await it.until(lambda: it.mode == "HOLD" and it.speed < 0.3, within=8.0)
        await it.drive(ahead(), 3.0)
        assert it.mode == "GUIDED", "and it is driven again"
        assert it.speed > 1.0

    driven(run_in_sim_time, sim_flight, drive)


@pytest.mark.parametrize("reason", ["hover", "brake", "emergency_stop", "pause"])
def test_every_stop_brakes_it_and_is_seen(run_in_sim_time, sim_flight, reason):
    async def drive(it):
        await it.drive(ahead(3.0), 4.0)
        began = it.now
        await it.adapter.stop(reason)
        assert it.now - began < 4.8, "before the host gives it up"
        assert it.mode == "HOLD"
        assert it.speed < 0.7 * 3.0

    driven(run_in_sim_time, sim_flight, drive)


def test_a_halt_writes_zero_and_hold_at_once(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(3.0), 4.0)
        it.adapter.halt()
        assert it.mode == "HOLD"

    driven(run_in_sim_time, sim_flight, drive)


def test_it_stops_by_itself_when_the_link_falls_silent(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(), 3.0)
        it.deaf_to = {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG", "COMMAND_INT"}
        await it.until(lambda: it.speed < 0.2, within=8.0)

    driven(run_in_sim_time, sim_flight, drive)


def test_it_goes_to_a_place_and_stands_there(run_in_sim_time, sim_flight):
    async def drive(it):
        steps = await exhausted(it.adapter.navigate(GoTo(to(12, 20))))
        assert steps[-1].percent == 100.0
        assert math.dist((it.place[1], it.place[0]), (12, 20)) <= NEAR
        assert it.armed

    driven(run_in_sim_time, sim_flight, drive)


def test_it_keeps_the_speed_that_a_goal_asks(run_in_sim_time, sim_flight):
    async def drive(it):
        fastest = 0.0
        async for _ in it.adapter.navigate(GoTo(to(0, 25), constraints=Constraints(max_speed=1.0))):
            fastest = max(fastest, it.speed)
        assert 0.8 < fastest < 1.3

    driven(run_in_sim_time, sim_flight, drive)


def test_it_follows_a_path(run_in_sim_time, sim_flight):
    async def drive(it):
        steps = await exhausted(it.adapter.navigate(FollowPath((to(0, 12), to(12, 12)))))
        assert steps[-1].reached == 2
        assert math.dist((it.place[1], it.place[0]), (12, 12)) <= NEAR

    driven(run_in_sim_time, sim_flight, drive)


def test_a_distance_backwards_is_driven_in_reverse_and_the_next_goal_ahead(run_in_sim_time, sim_flight):
    async def drive(it):
        await exhausted(it.adapter.navigate(RelativeMove(Vector3(-6.0, 0.0, 0.0))))
        assert along(it) < -3.0
        assert abs(math.remainder(it.sim.body.heading, math.tau)) < 0.2, "it did not turn round"
        await exhausted(it.adapter.navigate(GoTo(to(0, 10))))
        assert along(it) > 7.0
        assert abs(math.remainder(it.sim.body.heading, math.tau)) < 0.3, "nor drove back to front"

    driven(run_in_sim_time, sim_flight, drive)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (GoTo(to(5, 5, yaw=1.0)), "cannot turn to a yaw at a goal"),
        (FollowPath((to(5, 5), to(9, 9, yaw=0.0))), "cannot turn to a yaw"),
        (RelativeMove(Vector3(0.0, 2.0, 0.0)), "not sideways"),
        (RelativeMove(Vector3(2.0, 0.0, 1.0)), "on the surface"),
        (GoTo(to(0, 300_000)), "km away"),
    ],
)
def test_a_goal_that_it_cannot_drive_to_is_refused_and_not_sent(run_in_sim_time, sim_flight, task, words):
    async def drive(it):
        with pytest.raises(Refused, match=words):
            await exhausted(it.adapter.navigate(task))
        assert it.requested(192) == []

    driven(run_in_sim_time, sim_flight, drive)


def test_a_goal_beyond_its_limit_of_distance_is_refused(run_in_sim_time, sim_flight):
    async def drive(it):
        with pytest.raises(Refused, match="beyond the limit of 30 m"):
            await exhausted(it.adapter.navigate(GoTo(to(0, 40))))

    driven(run_in_sim_time, sim_flight, drive, limits={"distance": 30})


def test_it_drives_home_and_stands_there_armed(run_in_sim_time, sim_flight):
    async def drive(it):
        await exhausted(it.adapter.navigate(GoTo(to(0, 20))))
        await it.do("return_to_home")
        assert math.hypot(it.place[0], it.place[1]) <= NEAR
        assert it.armed
        assert it.mode == "RTL"

    driven(run_in_sim_time, sim_flight, drive)


@pytest.mark.parametrize("by", ["a halt", "the end of the edge"])
def test_its_way_home_is_not_left_to_itself(run_in_sim_time, sim_flight, by):
    async def drive(it):
        await it.drive(ahead(), 8.0)
        returning = asyncio.ensure_future(it.do("return_to_home"))
        await it.until(lambda: it.mode == "RTL")
        await asyncio.sleep(2)  # until it is on its way
        if by == "a halt":
            it.adapter.halt()
        else:
            await it.adapter.stop("the edge ends")
        await it.until(lambda: it.mode == "HOLD" and it.speed < 0.1)
        with pytest.raises(CommandError):
            await returning

    driven(run_in_sim_time, sim_flight, drive)


def test_it_is_disarmed_when_it_stands_and_not_before(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(), 3.0)
        with pytest.raises(Refused, match="it moves, and would coast"):
            await it.do("disarm", force=True)
        await it.adapter.stop("hover")
        await it.until(lambda: it.speed < 0.1)
        await asyncio.sleep(0.5)
        await it.do("disarm")
        assert not it.armed

    driven(run_in_sim_time, sim_flight, drive)


SURVEY = FlyMission(
    "survey",
    (
        PlanItem("waypoint", at(0, 15), speed=2.0),
        PlanItem("loiter_time", at(10, 15), seconds=2.0),
        PlanItem("waypoint", at(10, 0)),
    ),
)


def test_it_drives_a_mission_from_its_own_memory_and_arms_for_it(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            steps = await exhausted(it.adapter.navigate(SURVEY))
            assert steps[-1].reached == 3 or steps[-1].percent >= 99.0
            assert math.dist((it.place[1], it.place[0]), (10, 0)) <= NEAR
            assert it.mode == "HOLD"
            assert it.armed

    run_in_sim_time(main())


def test_a_paused_mission_goes_on_with_the_item_that_it_was_at(run_in_sim_time, sim_flight):
    async def drive(it):
        going = asyncio.ensure_future(exhausted(it.adapter.navigate(SURVEY)))
        await it.until(lambda: it.sim.pilot.missions.current >= 3 and it.speed > 1.0)
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)
        await it.adapter.stop("pause")
        assert it.mode == "HOLD"
        reached = it.sim.pilot.missions.current
        await exhausted(it.adapter.navigate(msgspec.structs.replace(SURVEY, resumed=True)))
        assert it.sim.pilot.missions.current >= reached
        assert math.dist((it.place[1], it.place[0]), (10, 0)) <= NEAR

    driven(run_in_sim_time, sim_flight, drive)


def test_a_mission_that_ends_at_home_ends_there_armed(run_in_sim_time, sim_flight):
    async def drive(it):
        homewards = FlyMission("home", (PlanItem("waypoint", at(0, 12)), PlanItem("return_to_launch")))
        await exhausted(it.adapter.navigate(homewards))
        assert math.hypot(it.place[0], it.place[1]) <= NEAR
        assert it.armed
        assert it.mode == "HOLD"

    driven(run_in_sim_time, sim_flight, drive)


def test_a_pilot_takes_it_and_a_stop_that_takes_over_takes_it_back(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.drive(ahead(), 3.0)
        it.sim.set_fault("pilot_takeover", 1.0)
        await it.until(lambda: it.robot.losses, within=3.0)
        with pytest.raises(NotReady, match="pilot or a fail-safe has it"):
            it.adapter.drive(ahead())
        with pytest.raises(Refused, match="left to that"):
            await it.adapter.stop("stop")
        await it.adapter.stop("hover")
        assert it.mode == "HOLD"
        await it.drive(ahead(), 2.0)

    driven(run_in_sim_time, sim_flight, drive)


def test_who_arms_it_in_manual_has_it_and_keeps_it_when_the_edge_ends(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            it.send_from_station(mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
            await it.until(lambda: it.state.armed)
            assert it.mode == "MANUAL"
            with pytest.raises(NotReady, match="a pilot or a fail-safe has it, in MANUAL"):
                it.adapter.drive(ahead())
            await it.adapter.stop("the edge ends")
            it.adapter.halt()
            assert it.mode == "MANUAL"
            await it.adapter.stop("hover")
            assert it.mode == "HOLD"

    run_in_sim_time(main())


def test_the_host_learns_what_it_lacks(run_in_sim_time, sim_flight):
    async def drive(it):
        assert it.robot.lacking == ArduRover.lacking
        for name in ("takeoff", "land", "ascend"):
            data = {"distance": 1.0} if name == "ascend" else {}
            with pytest.raises(Unsupported, match="moves on the surface"):
                await it.do(name, **data)

    driven(run_in_sim_time, sim_flight, drive)


def test_a_multirotor_on_the_link_of_a_rover_has_all_again(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            it.robot.lacks(ArduRover.lacking)  # as told by an attempt before this one
            await it.wait_until_known()
            await it.until(lambda: set(it.robot.lacking) == {"transition"})

    run_in_sim_time(main())


def test_its_fail_safes_are_those_of_a_rover(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover", failsafes="set") as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params["FS_GCS_ENABLE"] == 1, within=30.0)
            await it.until(lambda: it.robot.healths[-1].level is Level.OK, within=30.0)
            params = it.sim.pilot.params
            assert (params["FS_ACTION"], params["SYSID_MYGCS"], params["BATT_FS_LOW_ACT"]) == (1, 245, 2)

    run_in_sim_time(main())


def test_it_returns_by_itself_when_the_edge_falls_silent(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover", failsafes="set") as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params["SYSID_MYGCS"] == 245, within=30.0)
            await it.until(lambda: it.sim.pilot.params["FS_ACTION"] == 1, within=30.0)
            await it.do("arm")
            going = asyncio.ensure_future(exhausted(it.adapter.navigate(GoTo(to(0, 60)))))
            await it.until(lambda: it.place[0] > 15.0)
            it.deaf_to = {"HEARTBEAT", "COMMAND_LONG", "COMMAND_INT", "SET_POSITION_TARGET_LOCAL_NED"}
            await it.until(lambda: it.mode == "RTL", within=5.0)
            await it.until(lambda: math.hypot(it.place[0], it.place[1]) < NEAR, within=60.0)
            going.cancel()
            await asyncio.gather(going, return_exceptions=True)

    run_in_sim_time(main())


def test_a_fence_has_no_height(run_in_sim_time, sim_flight):
    async def main():
        fence = {"frame": "world", "inclusion": [[[-50, -50], [50, -50], [50, 50], [-50, 50]]]}
        async with sim_flight("ardupilot", vehicle="rover", fence=fence, limits={"distance": 80}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params["FENCE_ENABLE"] == 1, within=60.0)
            assert it.sim.pilot.params["FENCE_TYPE"] == 6

    run_in_sim_time(main())


def test_it_is_ready_when_arming_would_work(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            found = await it.do("check_ready")
            assert found["ready"]
            words = {each["check"]: each["words"] for each in found["checks"]}
            assert words["mode"] == ["MANUAL; arming it changes to GUIDED"]
            await it.do("arm")
            assert it.mode == "GUIDED"
            with pytest.raises(CommandError):
                await it.do("reboot")

    run_in_sim_time(main())


TURN = Velocity(Vector3(), 0.5)


def test_one_on_steered_wheels_does_not_turn_where_it_stands_and_says_so(run_in_sim_time, sim_flight):
    async def drive(it):
        await it.until(lambda: it.adapter._session.vehicle.turns_in_place is False, within=30.0)
        with pytest.raises(Unsupported, match="turns only while it drives"):
            it.adapter.drive(TURN)
        assert it.setpoints == []

    driven(run_in_sim_time, sim_flight, drive)


def test_one_that_is_steered_by_its_drives_turns_where_it_stands(run_in_sim_time, sim_flight):
    async def drive(it):
        it.sim.body.skid = True
        await it.do("set_parameter", name="SERVO1_FUNCTION", value=73, force=True)
        await it.until(lambda: it.now > 15.0)  # its own clock must have something to fall back by
        it.sim.set_fault("reboot", 1.0)
        await it.until(lambda: it.adapter._session.vehicle.turns_in_place is True, within=60.0)
        await it.until(lambda: it.state.home_altitude is not None and it.state.prearm_ok, within=60.0)
        await it.do("arm")
        before = it.sim.body.heading
        await it.drive(TURN, 3.0)
        assert math.remainder(it.sim.body.heading - before, math.tau) < -1.0

    driven(run_in_sim_time, sim_flight, drive)


def test_a_rover_that_is_not_seen_to_be_armed_yet_drives_home(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            arming = asyncio.ensure_future(it.do("arm"))
            await it.until(lambda: it.armed and not it.state.armed)
            arming.cancel()
            await it.do("return_to_home")
            assert it.mode == "RTL"

    run_in_sim_time(main())
