"""Goals, flown by both simulated autopilots."""

import asyncio
import itertools
import math

import pytest

from fleet import (
    FollowPath,
    GeoPoint,
    Goal,
    GoTo,
    NotReady,
    Refused,
    RelativeMove,
    TimedOut,
    Vector3,
    Velocity,
)
from fleet.errors import CommandError
from fleet.model.report import PoseReport
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
EXTERNAL = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))
STILL = Velocity()


async def exhausted(steps):
    """Let something run to its end."""
    async for _ in steps:
        pass


@both
def test_it_goes_to_a_place_in_the_world(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            goal = Goal(position=Vector3(10.0, 6.0, 7.0), yaw=math.pi)
            steps = [step async for step in it.adapter.navigate(GoTo(goal))]
            percents = [step.percent for step in steps]
            assert percents == sorted(percents)
            assert percents[-1] == 100.0
            assert not any(step.blocked for step in steps)
            assert it.place == pytest.approx((6.0, 10.0, 7.0), abs=0.7)
            assert math.degrees(it.sim.body.heading) % 360 == pytest.approx(270.0, abs=12)
            pose = it.robot.reports_of(PoseReport)[-1]
            assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((10, 6, 7), abs=1.0)

    run_in_sim_time(main())


@both
def test_it_keeps_the_speed_that_a_goal_asks(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            task = GoTo(Goal(position=Vector3(0.0, 20.0, 5.0)))
            task = GoTo(task.goal, constraints=type(task.constraints)(max_speed=1.0))
            fastest = 0.0
            async for _ in it.adapter.navigate(task):
                fastest = max(fastest, it.sim.body.vn)
            assert 0.7 < fastest < 1.3

    run_in_sim_time(main())


@both
def test_a_path_is_flown_in_order_with_its_waits(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            goals = (Goal(position=Vector3(0, 5, 5), wait=4.0), Goal(position=Vector3(5, 5, 5)))
            reached, at = [], []
            async for step in it.adapter.navigate(FollowPath(goals, loops=2)):
                reached.append(step.reached)
                at.append(it.now)
            assert reached == sorted(reached)
            assert reached[-1] == 4
            assert it.place[:2] == pytest.approx((5.0, 5.0), abs=0.7)
            assert max(later - sooner for sooner, later in itertools.pairwise(at)) >= 4.0

    run_in_sim_time(main())


@both
def test_a_relative_move_starts_from_where_it_is_and_looks(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(Velocity(yaw_rate=-0.5), 3.2)
            await it.drive(STILL, 3.0)
            heading = it.sim.body.heading
            async for _ in it.adapter.navigate(RelativeMove(Vector3(6.0, 0.0, 1.0))):
                pass
            expected = (6 * math.cos(heading), 6 * math.sin(heading), 6.0)
            assert it.place == pytest.approx(expected, abs=0.9)

    run_in_sim_time(main())


@both
def test_goals_beyond_the_limits_are_refused_before_anything_is_sent(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, limits={"altitude": 20.0, "distance": 50.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            before = len(it.commands)
            for place in (Vector3(0, 0, 21), Vector3(60, 0, 5), Vector3(0, 0, 0), Vector3(0, 0, -400)):
                with pytest.raises(Refused):
                    await anext(aiter(it.adapter.navigate(GoTo(Goal(position=place)))))
            with pytest.raises(Refused):
                await it.do("takeoff", altitude=21.0)
            assert [
                each for each in it.commands[before:] if each.command != MavCmd.SET_MESSAGE_INTERVAL
            ] == []

    run_in_sim_time(main())


@both
def test_a_goal_that_can_only_be_a_mistake_is_refused_without_any_limit(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            before = len(it.commands)
            mistakes = (
                Goal(position=Vector3(1e9, 0, 5)),
                Goal(position=Vector3(0, -1e300, 5)),
                Goal(position=Vector3(99_000, 99_000, 5)),
                Goal(geo=GeoPoint(8.545594, 47.397742, 493.0)),
            )
            for goal in mistakes:
                with pytest.raises(Refused, match=r"100 km|limit of 100000 m"):
                    await anext(aiter(it.adapter.navigate(GoTo(goal))))
            assert [
                each for each in it.commands[before:] if each.command != MavCmd.SET_MESSAGE_INTERVAL
            ] == []

    run_in_sim_time(main())


@both
def test_a_goal_against_too_much_wind_is_blocked_then_given_up(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            it.sim.set_fault("wind", 22.0)
            blocked = []

            async def watch():
                async for step in it.adapter.navigate(GoTo(Goal(position=Vector3(-30.0, 0.0, 10.0)))):
                    blocked.append(step.blocked)  # noqa: PERF401 - what was said until it raised counts

            with pytest.raises(TimedOut, match="not got nearer for 30 s"):
                await watch()
            assert blocked[0] is False
            assert blocked[-1] is True
            it.sim.set_fault("wind", None)
            await it.until(lambda: it.mode == HOLD[flavour], within=5.0)

    run_in_sim_time(main())


@both
def test_a_goal_on_earth_with_a_heading_is_flown_to(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            place = GeoPoint(47.397842, 8.545594, 498.0)  # 11.1 m north
            goal = Goal(geo=place, yaw=0.0)  # east
            await exhausted(it.adapter.navigate(GoTo(goal)))
            assert it.place == pytest.approx((11.1, 0.0, 10.0), abs=0.8)
            assert math.degrees(it.sim.body.heading) % 360 == pytest.approx(90.0, abs=12)

    run_in_sim_time(main())


@both
def test_a_takeover_ends_a_goal(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            going = it.adapter.navigate(GoTo(Goal(position=Vector3(40.0, 0.0, 10.0))))
            while (await anext(going)).percent < 20:
                pass
            it.sim.set_fault("pilot_takeover", 1.0)
            with pytest.raises(Refused, match="taken over"):
                await exhausted(going)
            assert it.mode in {"LOITER", "POSCTL"}

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("requested", ["hover", "emergency_stop"])
def test_a_stop_that_is_refused_during_a_fail_safe_gives_no_control_back(
    run_in_sim_time, sim_flight, flavour, requested
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=20.0)
            it.sim.set_fault("gps_loss", 1.0)
            await it.until(lambda: it.robot.losses, within=20.0)
            with pytest.raises(CommandError):
                await it.adapter.stop(requested)
            assert it.mode == "LAND"
            with pytest.raises(NotReady, match="a pilot or a fail-safe has it"):
                it.adapter.drive(FORWARD)
            with pytest.raises(NotReady, match="a pilot or a fail-safe has it"):
                await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(5.0, 0.0, 10.0)))))

    run_in_sim_time(main())


@both
def test_a_hold_that_is_refused_does_not_hide_why_a_goal_failed(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            it.sim.set_fault("wind", 30.0)
            going = it.adapter.navigate(GoTo(Goal(position=Vector3(-30.0, 0.0, 10.0))))
            await anext(going)
            it.deaf_to |= {"COMMAND_LONG", "COMMAND_INT"}
            with pytest.raises(TimedOut, match="not got nearer"):
                await exhausted(going)

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("delay", [0.0, 0.3, 0.6])
def test_a_goal_is_flown_to_though_a_mode_asked_for_just_before_is_shown_late(
    run_in_sim_time, sim_flight, flavour, delay
):
    async def main():
        async with sim_flight(flavour, faults={"state_lag": 1.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=8.0)
            overtaken = asyncio.ensure_future(it.do("return_to_home"))
            await it.until(lambda: it.mode == "RTL")
            await asyncio.sleep(delay)
            overtaken.cancel()
            await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(6.0, 4.0, 8.0)))))
            assert it.place == pytest.approx((4.0, 6.0, 8.0), abs=1.0)
            assert it.robot.losses == []

    run_in_sim_time(main())


def test_a_goal_is_flown_to_though_the_hold_after_a_drive_is_shown_late(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", faults={"state_lag": 1.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=8.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            it.adapter.drive(Velocity())
            await it.until(lambda: it.mode == "BRAKE")
            await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(6.0, 4.0, 8.0)))))
            assert it.place == pytest.approx((4.0, 6.0, 8.0), abs=1.0)

    run_in_sim_time(main())
