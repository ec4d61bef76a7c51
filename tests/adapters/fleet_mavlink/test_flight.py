"""Take-offs, landings and the other commands, on both simulated autopilots."""

import asyncio

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet.model.report import FlightStateReport
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
EXTERNAL = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))
STILL = Velocity()


@both
def test_it_takes_off_and_lands(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            percents = await it.do("takeoff", altitude=8.0)
            assert it.height == pytest.approx(8.0, abs=0.7)
            assert percents == sorted(percents)
            assert percents[-1] == 100.0
            await it.until(lambda: it.robot.reports_of(FlightStateReport)[-1].is_flying)
            await it.do("land")
            assert not it.armed
            assert it.height < 0.2

    run_in_sim_time(main())


@both
def test_a_takeoff_without_altitude_takes_the_configured_one(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, takeoff_altitude=4.0) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            assert it.height == pytest.approx(4.0, abs=0.7)

    run_in_sim_time(main())


@both
def test_a_takeoff_in_the_air_never_descends(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=8.0)
            await it.do("takeoff")
            await it.do("takeoff", altitude=3.0)
            await asyncio.sleep(5)
            assert it.height > 7.0
            await it.do("takeoff", altitude=12.0)
            assert it.height == pytest.approx(12.0, abs=0.7)

    run_in_sim_time(main())


@both
def test_it_climbs_and_sinks_by_a_distance_but_not_to_the_ground(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


@both
def test_it_returns_home_and_lands(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(8.0, 8.0, 6.0)))):
                pass
            await it.do("return_to_home")
            assert not it.armed
            assert it.place == pytest.approx((0.0, 0.0, 0.0), abs=1.0)

    run_in_sim_time(main())


@both
def test_a_refused_takeoff_is_reported_in_the_autopilots_words(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.sim.set_fault("not_ready", 1.0)
            with pytest.raises(CommandError) as refused:
                await it.do("takeoff")
            assert refused.value.messages
            assert refused.value.reason == "; ".join(refused.value.messages)
            assert refused.value.reason.startswith(("Arm: ", "Arming denied: "))
            assert refused.value.device_result in {"FAILED", "TEMPORARILY_REJECTED"}
            assert not it.armed

    run_in_sim_time(main())


@both
def test_lost_acknowledgements_do_not_make_it_do_things_twice(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.sim.set_fault("no_ack", 1.0)
            await it.do("takeoff", altitude=5.0)
            assert it.height == pytest.approx(5.0, abs=0.7)
            assert len(it.requested(MavCmd.COMPONENT_ARM_DISARM)) <= 2

    run_in_sim_time(main())


@both
def test_a_silent_link_is_reported_and_nothing_moves_when_it_comes_back(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


@both
def test_after_a_reboot_the_messages_are_asked_for_again(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await asyncio.sleep(10)
            await it.do("reboot")
            await it.until(lambda: it.state.reboots == 1)
            await it.until(lambda: it.state.home_altitude is not None)
            again = it.now
            await it.until(lambda: it.state.knows_where(it.robot.clock.monotonic()))
            assert it.now - again < 15.0
            await it.do("takeoff")

    run_in_sim_time(main())


@both
def test_it_is_not_rebooted_nor_disarmed_in_the_air(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            with pytest.raises(Refused, match="armed"):
                await it.do("reboot")
            for force in (False, True):
                with pytest.raises(Refused, match="in the air"):
                    await it.do("disarm", force=force)
            assert it.armed

    run_in_sim_time(main())


@both
def test_it_is_armed_and_disarmed_on_the_ground(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("arm")
            assert it.armed
            await it.do("disarm")
            assert not it.armed

    run_in_sim_time(main())


@both
def test_a_landing_can_be_cancelled(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


@both
def test_home_is_set_here(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(10.0, 0.0, 6.0)))):
                pass
            await it.do("set_home_here")
            await asyncio.sleep(3)
            assert it.state.relative_altitude == pytest.approx(6.0, abs=1.0)
            await it.do("return_to_home")
            assert it.place[:2] == pytest.approx((0.0, 10.0), abs=1.5)

    run_in_sim_time(main())


@both
def test_a_command_while_the_vehicle_is_silent_says_so(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            it.radio = False
            await asyncio.sleep(1)
            for name in ("takeoff", "land", "arm", "disarm", "reboot", "battery_check", "set_home_here"):
                with pytest.raises(NotReady, match="no heartbeat"):
                    await it.do(name)

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("command", ["land", "return_to_home"])
def test_a_way_down_goes_on_when_the_host_lets_go_and_ends_when_somebody_asks(
    run_in_sim_time, sim_flight, flavour, command
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=20.0)
            coming = asyncio.ensure_future(it.do(command))
            await asyncio.sleep(3.0)
            mode = it.mode
            it.adapter.halt()
            await it.adapter.stop("the edge has stopped running it")
            await asyncio.sleep(2.0)
            assert it.mode == mode
            it.adapter.emergency_halt()
            await it.until(lambda: it.mode == HOLD[flavour], within=2.0)
            coming.cancel()

    run_in_sim_time(main())


@both
@pytest.mark.parametrize(("name", "data"), [("disarm", {}), ("land", {}), ("kill", {"force": True})])
def test_motors_that_are_not_seen_to_run_yet_are_switched_off(
    run_in_sim_time, sim_flight, flavour, name, data
):
    async def main():
        async with sim_flight(flavour, allow_kill=True, faults={"state_lag": 0.5}) as it:
            await it.wait_until_known()
            arming = asyncio.ensure_future(it.do("arm"))
            await it.until(lambda: it.armed)
            assert not it.state.armed
            arming.cancel()
            await it.do(name, **data)
            assert not it.armed
            await asyncio.sleep(3.0)
            assert not it.armed

    run_in_sim_time(main())


def test_motors_are_not_stopped_by_force_in_the_air_that_is_not_seen_yet(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight(
            "ardupilot", faults={"state_lag": 1.5}
        ) as it:  # PX4 says it before it leaves the ground
            await it.wait_until_known()
            rising = asyncio.ensure_future(it.do("takeoff", altitude=6.0))
            await it.until(lambda: it.height > 0.3)
            assert it.state.in_air is False
            rising.cancel()
            with pytest.raises(CommandError):
                await it.do("disarm", force=True)
            assert it.armed

    run_in_sim_time(main())


@both
def test_a_landing_right_after_a_halt_is_not_undone_by_the_hold_that_follows_the_halt(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, faults={"state_lag": 0.5}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=6.0)
            await it.adapter.stop("hover")
            it.adapter.drive(FORWARD)
            await it.until(lambda: it.adapter._session.commander.turns.current is not None)
            it.adapter.halt()  # the watchdog's: the only velocity has had its time
            await it.do("land")
            assert not it.armed

    run_in_sim_time(main())
