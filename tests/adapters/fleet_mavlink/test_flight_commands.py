"""Take-off, landing, return to home and changes of height, on both simulated autopilots."""

import asyncio

import pytest

from fleet import Goal, GoTo, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.report import FlightStateReport

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
FORWARD = Velocity(Vector3(2.0, 0.0, 0.0))


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
