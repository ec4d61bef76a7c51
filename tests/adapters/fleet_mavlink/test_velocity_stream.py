"""Velocities: streamed to both simulated autopilots, and never left without a hold."""

import asyncio
import contextlib
import math

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3, Velocity
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
EXTERNAL = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))
STILL = Velocity()


@both
def test_it_moves_where_its_nose_points_and_holds_its_heading(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


@both
def test_while_it_drives_a_new_velocity_leaves_at_once(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 2.0)
            assert it.mode == EXTERNAL[flavour]
            for climb in (0.5, 1.0, 0.75):  # each within one period of the stream
                it.adapter.drive(Velocity(Vector3(0.0, 0.0, climb)))
                await asyncio.sleep(0.01)
                assert it.setpoints[-1][1].vz == -climb
            it.adapter.drive(STILL)
            await asyncio.sleep(0.01)
            assert it.setpoints[-1][1].vx == it.setpoints[-1][1].vz == 0

    run_in_sim_time(main())


@both
def test_after_a_rest_it_is_left_to_its_own_hold(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


def test_px4_hears_zeros_until_it_has_left_offboard(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 2.0)
            stopping = asyncio.ensure_future(it.adapter.stop("emergency_stop"))
            while not stopping.done():
                heard, _ = it.setpoints[-1]
                assert it.mode != "OFFBOARD" or it.now - heard < 0.3
                await asyncio.sleep(0.02)
            last = it.setpoints[-1][1]
            assert (last.vx, last.vy, last.vz, last.yaw_rate) == (0, 0, 0, 0)
            assert it.mode == "LOITER"

    run_in_sim_time(main())


def test_px4_hears_setpoints_before_it_is_asked_to_obey_them_and_moves_as_soon_as_it_does(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            it.order.clear()
            await it.drive(FORWARD, 2.0)
            assert it.mode == "OFFBOARD"
            assert it.order[: it.order.index(MavCmd.DO_SET_MODE)].count(0) >= 5
            assert it.speed > 0.5
            assert "Failsafe activated" not in [said.text for said in it.adapter._session.vehicle.sentences]

    run_in_sim_time(main())


@both
def test_stop_brakes_and_holds(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            began = it.now
            await it.adapter.stop("emergency_stop")
            assert it.now - began < 2.0
            assert it.mode == HOLD[flavour]
            await it.until(lambda: it.speed < 0.2, within=4.0)

    run_in_sim_time(main())


@both
def test_a_plain_stop_stands_still_and_then_holds(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            await it.adapter.stop("stop")
            assert it.speed <= 0.6
            await it.until(lambda: it.mode == HOLD[flavour], within=4.0)

    run_in_sim_time(main())


@both
def test_a_burst_right_after_a_stop_moves_the_vehicle(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            for _ in range(3):
                await it.drive(FORWARD, 1.0)
                assert it.speed > 0.3
                await it.adapter.stop("stop")
            await it.adapter.stop("hover")
            await it.drive(FORWARD, 1.0)
            assert it.speed > 0.2

    run_in_sim_time(main())


@both
def test_halt_alone_brings_it_to_a_standstill_while_the_loop_is_stuck(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            it.robot.close()  # the scheduler stands still: nothing of ours goes on
            height = it.height
            it.adapter.halt()
            await asyncio.sleep(8)
            assert it.speed < 0.2
            assert it.height == pytest.approx(height, abs=0.8)

    run_in_sim_time(main())


@both
def test_the_ceiling_holds_while_driving_up(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, limits={"altitude": 8.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=6.0)
            await it.drive(Velocity(Vector3(0.0, 0.0, 1.5)), 8.0)
            assert 7.5 < it.height < 9.5

    run_in_sim_time(main())


@both
def test_a_pilot_who_takes_over_ends_our_motion_until_a_new_command(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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
            with pytest.raises(Refused, match="left to that"):
                await it.adapter.stop("stop")  # the end of an operator's burst
            await it.adapter.stop("the edge ends")
            await asyncio.sleep(1)
            assert it.mode == pilots
            assert len(it.setpoints) == streamed
            await it.adapter.stop("hover")
            assert it.mode == HOLD[flavour]
            await it.drive(FORWARD, 2.0)
            assert it.mode == EXTERNAL[flavour]

    run_in_sim_time(main())


@both
def test_nothing_drives_on_the_ground(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            with pytest.raises(NotReady, match="not in the air"):
                it.adapter.drive(FORWARD)
            it.adapter.drive(STILL)
            await asyncio.sleep(1)
            assert it.setpoints == []

    run_in_sim_time(main())


@both
def test_cancelling_a_return_takes_it_even_from_the_fail_safe_that_began_it(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=15.0)
            it.sim.set_fault("pilot_takeover", 1.0)
            await it.until(lambda: it.robot.losses)
            await it.do("cancel_return_to_home")
            assert it.mode == HOLD[flavour]

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("rest", [1.1, 1.5])
def test_a_landing_right_after_a_drive_is_not_taken_for_a_pilots(run_in_sim_time, sim_flight, flavour, rest):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            await it.drive(STILL, rest)  # its own hold is under way
            await it.do("land")
            assert not it.armed
            assert it.robot.losses == []

    run_in_sim_time(main())


@both
def test_a_landing_whose_first_message_is_lost_is_not_undone_by_the_drives_own_hold(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            await it.drive(FORWARD, 3.0)
            landing = asyncio.ensure_future(it.do("land"))
            it.radio = False
            await asyncio.sleep(0.1)
            it.radio = True
            await landing
            assert not it.armed
            assert it.robot.losses == []

    run_in_sim_time(main())


def test_a_plain_stop_holds_a_vehicle_that_was_on_its_way_and_does_not_take_velocities(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            steps = it.adapter.navigate(GoTo(Goal(Vector3(300.0, 0.0, 10.0))))
            await anext(steps)
            await asyncio.sleep(4)
            vehicle = it.adapter._session.vehicle
            send = vehicle._send
            vehicle._send = lambda message, address: (
                None if getattr(message, "command", 0) == MavCmd.DO_SET_MODE else send(message, address)
            )
            it.adapter.drive(FORWARD)
            await it.adapter.stop("stop")
            await it.until(lambda: it.speed < 0.2, within=6.0)

    run_in_sim_time(main())


def test_a_goal_after_a_short_drive_is_not_held_up_by_a_mode_that_is_shown_late(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", faults={"state_lag": 1.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=6.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 1.0)
            assert it.mode == "OFFBOARD"
            async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(6.0, 0.0, 6.0)))):
                pass
            assert it.place == pytest.approx((0.0, 6.0, 6.0), abs=1.0)

    run_in_sim_time(main())
