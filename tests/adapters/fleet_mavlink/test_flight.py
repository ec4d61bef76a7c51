"""Motors, home, reboots and a silent link, on both simulated autopilots."""

import asyncio

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))


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
