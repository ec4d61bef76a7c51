"""Both autopilots flown through the adapter, on a simulator that refuses what the real ones refuse."""

import asyncio
import contextlib
import math

import pytest

from fleet import FollowPath, Goal, GoTo, NotReady, Refused, RelativeMove, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet.model.report import FlightStateReport, PoseReport
from fleet_mavlink.words import Cmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
EXTERNAL = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))
STILL = Velocity()


def of(reports, kind):
    return [report for report in reports if isinstance(report, kind)]


@both
def test_it_takes_off_and_lands(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            percents = await it.do("takeoff", altitude=8.0)
            assert it.height == pytest.approx(8.0, abs=0.7)
            assert percents == sorted(percents)
            assert percents[-1] == 100.0
            await it.until(lambda: of(it.robot.reports, FlightStateReport)[-1].is_flying)
            await it.do("land")
            assert not it.armed
            assert it.height < 0.2

    fly(main())


@both
def test_a_takeoff_without_altitude_takes_the_configured_one(fly, sky, flavour):
    async def main():
        async with sky(flavour, takeoff_altitude=4.0) as it:
            await it.met()
            await it.do("takeoff")
            assert it.height == pytest.approx(4.0, abs=0.7)

    fly(main())


@both
def test_a_takeoff_in_the_air_never_descends(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=8.0)
            await it.do("takeoff")
            await it.do("takeoff", altitude=3.0)
            await asyncio.sleep(5)
            assert it.height > 7.0
            await it.do("takeoff", altitude=12.0)
            assert it.height == pytest.approx(12.0, abs=0.7)

    fly(main())


@both
def test_it_moves_where_its_nose_points_and_holds_its_heading(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=6.0)
            await it.drive(Velocity(yaw_rate=-0.5), 4.0)  # to the right, about to the east
            await it.drive(STILL, 3.0)
            north, east, _ = it.place
            heading = it.sim.body.heading
            assert heading > 1.0
            await it.drive(Velocity(Vector3(0.0, 2.0, 0.0)), 4.0)  # to its left
            await it.drive(STILL, 3.0)
            moved = (it.place[0] - north, it.place[1] - east)
            assert math.hypot(*moved) > 3.0
            left = heading - math.pi / 2
            assert math.atan2(moved[1], moved[0]) == pytest.approx(left, abs=0.2)
            assert it.sim.body.heading == pytest.approx(heading, abs=0.1)
            assert it.height == pytest.approx(6.0, abs=0.8)

    fly(main())


@both
def test_after_a_rest_it_is_left_to_its_own_hold(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(FORWARD, 2.0)
            assert it.mode == EXTERNAL[flavour]
            it.adapter.drive(STILL)
            await it.until(lambda: it.mode == HOLD[flavour], within=5.0)
            await it.until(lambda: it.speed < 0.2, within=5.0)
            await asyncio.sleep(1.5)
            streamed = len(it.setpoints)
            await asyncio.sleep(3)
            assert len(it.setpoints) == streamed
            assert it.robot.losses == []

    fly(main())


def test_px4_hears_zeros_until_it_has_left_offboard(fly, sky):
    async def main():
        async with sky("px4") as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(FORWARD, 2.0)
            stopping = asyncio.ensure_future(it.adapter.stop("stop"))
            while not stopping.done():
                heard, _ = it.setpoints[-1]
                assert it.mode != "OFFBOARD" or it.now - heard < 0.3
                await asyncio.sleep(0.02)
            last = it.setpoints[-1][1]
            assert (last.vx, last.vy, last.vz, last.yaw_rate) == (0, 0, 0, 0)
            assert it.mode == "LOITER"

    fly(main())


def test_px4_hears_setpoints_before_it_is_asked_to_obey_them(fly, sky):
    async def main():
        async with sky("px4") as it:
            await it.met()
            await it.do("takeoff")
            began = it.now
            await it.drive(FORWARD, 2.0)
            assert it.mode == "OFFBOARD"
            early = [message.vx for at, message in it.setpoints if at - began < 0.5]
            assert len(early) >= 9
            assert set(early) == {0.0}
            assert "Failsafe activated" not in [said.text for said in it.adapter._session.vehicle.sentences]

    fly(main())


@both
def test_stop_brakes_and_holds(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            began = it.now
            await it.adapter.stop("stop")
            assert it.now - began < 2.0
            assert it.mode == HOLD[flavour]
            await it.until(lambda: it.speed < 0.2, within=4.0)

    fly(main())


@both
def test_halt_alone_brings_it_to_a_standstill_while_the_loop_is_stuck(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            it.robot.close()  # the wheel stands still: nothing of ours goes on
            height = it.height
            it.adapter.halt()
            await asyncio.sleep(8)
            assert it.speed < 0.2
            assert it.height == pytest.approx(height, abs=0.8)

    fly(main())


@both
def test_it_goes_to_a_place_in_the_world(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            goal = Goal(position=Vector3(10.0, 6.0, 7.0), yaw=math.pi)
            steps = [step async for step in it.adapter.navigate(GoTo(goal))]
            percents = [step.percent for step in steps]
            assert percents == sorted(percents)
            assert percents[-1] == 100.0
            assert not any(step.blocked for step in steps)
            assert it.place == pytest.approx((6.0, 10.0, 7.0), abs=0.7)
            assert math.degrees(it.sim.body.heading) % 360 == pytest.approx(270.0, abs=12)
            pose = of(it.robot.reports, PoseReport)[-1]
            assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((10, 6, 7), abs=1.0)

    fly(main())


@both
def test_it_keeps_the_speed_that_a_goal_asks(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            task = GoTo(Goal(position=Vector3(0.0, 20.0, 5.0)))
            task = GoTo(task.goal, constraints=type(task.constraints)(max_speed=1.0))
            fastest = 0.0
            async for _ in it.adapter.navigate(task):
                fastest = max(fastest, it.sim.body.vn)
            assert 0.7 < fastest < 1.3

    fly(main())


@both
def test_a_path_is_flown_in_order_with_its_waits(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            goals = (Goal(position=Vector3(0, 5, 5), wait=4.0), Goal(position=Vector3(5, 5, 5)))
            reached, at = [], []
            async for step in it.adapter.navigate(FollowPath(goals, loops=2)):
                reached.append(step.reached)
                at.append(it.now)
            assert reached == sorted(reached)
            assert reached[-1] == 4
            assert it.place[:2] == pytest.approx((5.0, 5.0), abs=0.7)
            assert max(later - sooner for sooner, later in zip(at, at[1:], strict=False)) >= 4.0

    fly(main())


@both
def test_a_relative_move_starts_from_where_it_is_and_looks(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(Velocity(yaw_rate=-0.5), 3.2)
            await it.drive(STILL, 3.0)
            heading = it.sim.body.heading
            async for _ in it.adapter.navigate(RelativeMove(Vector3(6.0, 0.0, 1.0))):
                pass
            expected = (6 * math.cos(heading), 6 * math.sin(heading), 6.0)
            assert it.place == pytest.approx(expected, abs=0.9)

    fly(main())


@both
def test_it_climbs_and_sinks_by_a_distance_but_not_to_the_ground(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            before = it.height
            await it.do("ascend", distance=3.0)
            assert it.height == pytest.approx(before + 3.0, abs=0.7)
            before = it.height
            await it.do("descend", distance=4.0)
            assert it.height == pytest.approx(before - 4.0, abs=0.7)
            with pytest.raises(Refused, match="below 1 m"):
                await it.do("descend", distance=4.0)
            with pytest.raises(Refused, match="over the limit of 120 m"):
                await it.do("ascend", distance=400.0)

    fly(main())


@both
def test_goals_beyond_the_limits_are_refused_before_anything_is_sent(fly, sky, flavour):
    async def main():
        async with sky(flavour, limits={"altitude": 20.0, "distance": 50.0}) as it:
            await it.met()
            await it.do("takeoff")
            before = len(it.commands)
            for place in (Vector3(0, 0, 21), Vector3(60, 0, 5), Vector3(0, 0, 0), Vector3(0, 0, -400)):
                with pytest.raises(Refused):
                    await anext(aiter(it.adapter.navigate(GoTo(Goal(position=place)))))
            with pytest.raises(Refused):
                await it.do("takeoff", altitude=21.0)
            assert [each for each in it.commands[before:] if each.command != Cmd.SET_MESSAGE_INTERVAL] == []

    fly(main())


@both
def test_the_ceiling_holds_while_driving_up(fly, sky, flavour):
    async def main():
        async with sky(flavour, limits={"altitude": 8.0}) as it:
            await it.met()
            await it.do("takeoff", altitude=6.0)
            await it.drive(Velocity(Vector3(0.0, 0.0, 1.5)), 8.0)
            assert 7.5 < it.height < 9.5

    fly(main())


@both
def test_it_returns_home_and_lands(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(8.0, 8.0, 6.0)))):
                pass
            await it.do("return_to_home")
            assert not it.armed
            assert it.place == pytest.approx((0.0, 0.0, 0.0), abs=1.0)

    fly(main())


@both
def test_a_refused_takeoff_is_told_in_the_autopilots_words(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            it.sim.set_fault("not_ready", 1.0)
            with pytest.raises(CommandError) as refused:
                await it.do("takeoff")
            assert refused.value.messages
            assert refused.value.reason == "; ".join(refused.value.messages)
            assert refused.value.reason.startswith(("Arm: ", "Arming denied: "))
            assert refused.value.device_result in {"FAILED", "TEMPORARILY_REJECTED"}
            assert not it.armed

    fly(main())


@both
def test_lost_acknowledgements_do_not_make_it_do_things_twice(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            it.sim.set_fault("no_ack", 1.0)
            await it.do("takeoff", altitude=5.0)
            assert it.height == pytest.approx(5.0, abs=0.7)
            assert len(it.asked(Cmd.COMPONENT_ARM_DISARM)) <= 2

    fly(main())


@both
def test_a_pilot_who_takes_over_ends_our_motion_until_a_new_command(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=20.0)
            await it.drive(FORWARD, 2.0)
            it.sim.set_fault("pilot_takeover", 1.0)
            pilots = it.mode
            with contextlib.suppress(NotReady):
                await it.drive(FORWARD, 1.5)
            assert len(it.robot.losses) == 1
            streamed = len(it.setpoints)
            with pytest.raises(NotReady, match="hover"):
                it.adapter.drive(FORWARD)
            await it.adapter.stop("stop")  # the end of an operator's burst
            await asyncio.sleep(1)
            assert it.mode == pilots
            assert len(it.setpoints) == streamed
            await it.adapter.stop("hover")
            assert it.mode == HOLD[flavour]
            await it.drive(FORWARD, 2.0)
            assert it.mode == EXTERNAL[flavour]

    fly(main())


@both
def test_a_takeover_ends_a_goal(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=10.0)
            with pytest.raises(Refused, match="taken over"):
                async for step in it.adapter.navigate(GoTo(Goal(position=Vector3(40.0, 0.0, 10.0)))):
                    if step.percent > 20:
                        it.sim.set_fault("pilot_takeover", 1.0)
            assert it.mode in {"LOITER", "POSCTL"}

    fly(main())


@both
def test_a_silent_link_is_told_and_nothing_moves_when_it_comes_back(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            await it.drive(FORWARD, 2.0)
            it.radio = False
            await it.until(lambda: it.robot.healths[-1].level is Level.OFFLINE, within=6.0)
            assert "no heartbeat from system 1" in it.robot.healths[-1].cause
            with pytest.raises(NotReady, match="no heartbeat"):
                it.adapter.drive(FORWARD)
            it.radio = True
            await it.until(lambda: it.robot.healths[-1].level < Level.OFFLINE, within=6.0)
            heard = len(it.setpoints)
            await asyncio.sleep(3)
            moving = [each for _, each in it.setpoints[heard:] if (each.vx, each.vy, each.vz) != (0, 0, 0)]
            assert moving == []

    fly(main())


@both
def test_after_a_reboot_the_messages_are_asked_for_again(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await asyncio.sleep(10)
            await it.do("reboot")
            await it.until(lambda: it.state.reboots == 1)
            await it.until(lambda: it.state.home_altitude is not None)
            again = it.now
            await it.until(lambda: it.state.knows_where(it.robot.monotonic()))
            assert it.now - again < 15.0
            await it.do("takeoff")

    fly(main())


@both
def test_it_is_not_rebooted_nor_disarmed_in_the_air(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            with pytest.raises(Refused, match="armed"):
                await it.do("reboot")
            for force in (False, True):
                with pytest.raises(Refused, match="in the air"):
                    await it.do("disarm", force=force)
            assert it.armed

    fly(main())


@both
def test_it_is_armed_and_disarmed_on_the_ground(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("arm")
            assert it.armed
            await it.do("disarm")
            assert not it.armed

    fly(main())


@both
def test_nothing_drives_on_the_ground(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            with pytest.raises(NotReady, match="not in the air"):
                it.adapter.drive(FORWARD)
            it.adapter.drive(STILL)
            await asyncio.sleep(1)
            assert it.setpoints == []

    fly(main())


@both
def test_a_landing_can_be_cancelled(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=10.0)
            landing = asyncio.ensure_future(it.do("land"))
            await it.until(lambda: it.height < 8.0)
            await it.do("cancel_landing")
            with pytest.raises(Refused):
                await landing
            assert it.mode == HOLD[flavour]
            height = it.height
            await asyncio.sleep(5)
            assert it.height == pytest.approx(height, abs=1.5)

    fly(main())


@both
def test_home_is_set_here(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(10.0, 0.0, 6.0)))):
                pass
            await it.do("set_home_here")
            await asyncio.sleep(3)
            assert it.state.relative_altitude == pytest.approx(6.0, abs=1.0)
            await it.do("return_to_home")
            assert it.place[:2] == pytest.approx((0.0, 10.0), abs=1.5)

    fly(main())


@both
def test_a_command_while_the_vehicle_is_silent_says_so(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            it.radio = False
            await asyncio.sleep(1)
            for name in ("takeoff", "land", "arm", "disarm", "reboot", "battery_check", "set_home_here"):
                with pytest.raises(NotReady, match="no heartbeat"):
                    await it.do(name)

    fly(main())
