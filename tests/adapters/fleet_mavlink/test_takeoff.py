"""Take-offs: to their height by whatever end the autopilot gives them, and out of a landing."""

import asyncio
import contextlib

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HEIGHTS = [2.0, 3.0, 5.0, 12.0]
EXACT = 0.4  # m


@contextlib.asynccontextmanager
async def ended(doing):
    """Run something beside the test; the host ends it with the next command."""
    task = asyncio.ensure_future(doing)
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.mark.combinations
@both
@pytest.mark.parametrize("altitude", HEIGHTS)
def test_it_takes_off_to_any_height(run_in_sim_time, sim_flight, flavour, altitude):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            percents = await it.do("takeoff", altitude=altitude)
            assert percents[-1] == 100.0
            assert it.state.relative_altitude == pytest.approx(altitude, abs=EXACT)
            await asyncio.sleep(3.0)
            assert it.state.relative_altitude == pytest.approx(altitude, abs=EXACT)
            assert it.robot.losses == []

    run_in_sim_time(main())


@pytest.mark.combinations
@pytest.mark.parametrize("altitude", HEIGHTS)
@pytest.mark.parametrize("wait", [0.0, 2.0, 4.0, 6.0])
def test_a_home_that_is_set_again_at_the_takeoff_is_made_good(run_in_sim_time, sim_flight, altitude, wait):
    async def main():
        async with sim_flight("px4", faults={"wander": 1.0}) as it:
            await it.wait_until_known()
            await asyncio.sleep(wait)
            await it.do("takeoff", altitude=altitude)
            assert it.state.relative_altitude == pytest.approx(altitude, abs=EXACT)
            assert it.mode == "LOITER"

    run_in_sim_time(main())


@pytest.mark.parametrize("wait", [2.0, 4.0])
def test_it_does_not_climb_on_to_a_height_above_the_home_before(run_in_sim_time, sim_flight, wait):
    async def main():
        async with sim_flight("px4", faults={"wander": 0.5}) as it:
            await it.wait_until_known()
            await asyncio.sleep(wait)
            await it.do("takeoff", altitude=5.0)
            await asyncio.sleep(5.0)
            assert it.state.relative_altitude == pytest.approx(5.0, abs=EXACT)

    run_in_sim_time(main())


@pytest.mark.combinations
@both
@pytest.mark.parametrize("altitude", [1.0, 5.0])
def test_a_takeoff_to_a_limit_is_not_refused_by_it(run_in_sim_time, sim_flight, flavour, altitude):
    async def main():
        async with sim_flight(flavour, limits={"altitude": 5.0}, faults={"wander": 1.0}) as it:
            await it.wait_until_known()
            for _ in range(3):
                await it.do("takeoff", altitude=altitude)
                assert it.state.relative_altitude == pytest.approx(altitude, abs=EXACT)
                await it.do("land")

    run_in_sim_time(main())


@both
def test_it_takes_off_in_wind(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, faults={"wind": 9.0}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=6.0)
            assert it.state.relative_altitude == pytest.approx(6.0, abs=0.5)

    run_in_sim_time(main())


@pytest.mark.parametrize("radius", [0.3, 0.8, 2.5])
def test_the_autopilots_own_end_of_a_takeoff_counts_however_early(run_in_sim_time, sim_flight, radius):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("set_parameter", name="NAV_MC_ALT_RAD", value=radius)
            await it.do("takeoff", altitude=6.0)
            assert it.state.relative_altitude == pytest.approx(6.0, abs=EXACT)

    run_in_sim_time(main())


def test_a_takeoff_that_another_station_broke_off_is_not_flown_on(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            async with ended(it.do("takeoff", altitude=12.0)) as rising:
                await it.until(lambda: it.height > 3.0)
                it.sim.pilot.enter(it.sim.pilot.chosen)
                with pytest.raises(Refused, match="the take-off ended at"):
                    await rising
            await asyncio.sleep(5.0)
            assert it.height < 6.0

    run_in_sim_time(main())


MOMENTS = [
    ("high", lambda it: it.height < 6.0),
    ("low", lambda it: it.height < 1.5),
    ("last", lambda it: it.height < 0.3),
    ("touched", lambda it: it.sim.body.grounded),
    ("off", lambda it: not it.armed),
]


@pytest.mark.combinations
@both
@pytest.mark.parametrize("come", [come for _, come in MOMENTS], ids=[name for name, _ in MOMENTS])
@pytest.mark.parametrize("later", [0.0, 0.6, 1.2, 1.8, 1.9, 2.1])
def test_a_takeoff_out_of_a_landing_or_right_after_it_flies(
    run_in_sim_time, sim_flight, flavour, come, later
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=8.0)
            async with ended(it.do("land")):
                await it.until(lambda: come(it))
                await asyncio.sleep(later)
            await it.do("takeoff", altitude=7.0)
            assert it.armed
            assert it.state.relative_altitude == pytest.approx(7.0, abs=EXACT)
            await asyncio.sleep(15.0)
            assert it.state.relative_altitude == pytest.approx(7.0, abs=EXACT)
            assert it.robot.losses == []
            await it.do("land")
            assert not it.armed

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("data", [{}, {"altitude": 3.0}])
def test_a_takeoff_during_a_landing_never_descends(run_in_sim_time, sim_flight, flavour, data):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            async with ended(it.do("land")):
                await it.until(lambda: it.height < 8.0)
            await it.do("takeoff", **data)
            await asyncio.sleep(10.0)
            assert it.height > 6.5

    run_in_sim_time(main())


@both
def test_a_second_takeoff_goes_on_with_the_first(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            for moment in (1.0, 3.0, 6.0):
                async with ended(it.do("takeoff", altitude=4.0)):
                    await asyncio.sleep(moment)
                await it.do("takeoff", altitude=6.0)
                assert it.state.relative_altitude == pytest.approx(6.0, abs=EXACT)
                await it.do("land")

    run_in_sim_time(main())


def test_a_second_takeoff_goes_on_with_the_first_before_it_is_seen_to_fly(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:  # refuses a take-off in the air; PX4 takes it
            await it.wait_until_known()
            for _ in range(2):
                async with ended(it.do("takeoff", altitude=4.0)):
                    await it.until(lambda: it.sim.pilot.flying and it.state.in_air is False)
                await it.do("takeoff", altitude=6.0)
                assert it.state.relative_altitude == pytest.approx(6.0, abs=EXACT)
                await it.do("land")

    run_in_sim_time(main())


@both
def test_a_takeoff_does_not_take_the_drone_from_its_pilot(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            it.sim.set_fault("pilot_takeover", 1.0)
            await it.until(lambda: it.robot.losses, within=5.0)
            requested = len(it.requested(MavCmd.NAV_TAKEOFF))
            with pytest.raises(NotReady, match="a pilot or a fail-safe has it"):
                await it.do("takeoff", altitude=9.0)
            assert len(it.requested(MavCmd.NAV_TAKEOFF)) == requested

    run_in_sim_time(main())


@both
def test_a_goal_during_a_takeoff_is_refused_as_busy(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            async with ended(it.do("takeoff", altitude=10.0)) as rising:
                for height in (0.05, 1.0, 5.0):
                    await it.until(lambda: it.height > height)  # noqa: B023 - awaited at once
                    with pytest.raises(NotReady, match="busy"):
                        await anext(it.adapter.navigate(GoTo(Goal(position=Vector3(5.0, 0.0, 5.0)))))
                    await it.do("arm")
                await rising
            assert it.height == pytest.approx(10.0, abs=EXACT)

    run_in_sim_time(main())


def test_a_quadplane_takes_off_again_though_it_says_that_it_flies_once_it_is_armed(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: "Q_GUIDED_MODE" in it.state.settings)
            await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
            for _ in range(2):
                await it.do("takeoff", altitude=20.0)
                assert it.height == pytest.approx(20.0, abs=1.0)
                await it.do("land")

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("data", [{}, {"altitude": 3.0}])
def test_a_takeoff_in_the_air_ends_the_flight_that_the_host_has_ended(
    run_in_sim_time, sim_flight, flavour, data
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=8.0)
            async with contextlib.aclosing(it.adapter.navigate(GoTo(Goal(Vector3(90.0, 0.0, 8.0))))) as way:
                await anext(way)
                await it.until(lambda: it.speed > 3.0)
            await it.do("takeoff", **data)
            await asyncio.sleep(4.0)
            assert it.speed < 0.3
            assert it.height == pytest.approx(8.0, abs=EXACT)

    run_in_sim_time(main())


def test_a_second_takeoff_to_a_lower_height_before_it_is_seen_to_fly_never_descends(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot", faults={"state_lag": 1.2}) as it:
            await it.wait_until_known()
            async with ended(it.do("takeoff", altitude=12.0)):
                await it.until(lambda: it.height > 2.0)
                assert it.state.in_air is False
            await it.do("takeoff", altitude=1.5)
            await asyncio.sleep(5.0)
            assert it.height > 2.0

    run_in_sim_time(main())


def test_a_takeoff_flies_though_a_hold_that_was_asked_for_before_is_shown_late(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", faults={"state_lag": 1.0}) as it:
            await it.wait_until_known()
            await it.do("arm")
            async with ended(it.adapter.stop("hover")):
                await it.until(lambda: it.mode == "BRAKE")
            await it.do("takeoff", altitude=5.0)
            assert it.state.relative_altitude == pytest.approx(5.0, abs=EXACT)

    run_in_sim_time(main())


@both
def test_a_takeoff_flies_though_a_landing_that_was_asked_for_before_is_shown_late(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, faults={"state_lag": 1.0}) as it:
            await it.wait_until_known()
            async with ended(it.do("takeoff", altitude=9.0)):
                await it.until(lambda: it.state.in_air and it.height > 1.0)
            async with ended(it.do("land")):
                await it.until(lambda: it.mode == "LAND")
            await it.do("takeoff", altitude=8.0)
            assert it.armed
            assert it.state.relative_altitude == pytest.approx(8.0, abs=EXACT)

    run_in_sim_time(main())


def test_a_takeoff_right_after_a_disarm_that_is_shown_late_arms_again(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", faults={"state_lag": 1.2}) as it:
            await it.wait_until_known()
            await it.do("arm")
            async with ended(it.do("disarm")):
                await it.until(lambda: not it.armed)
            assert it.state.armed
            await it.do("takeoff", altitude=5.0)
            assert it.state.relative_altitude == pytest.approx(5.0, abs=EXACT)

    run_in_sim_time(main())
