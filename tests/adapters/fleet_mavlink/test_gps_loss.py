"""A lost position: told in words, and what is not to be trusted ends."""

import asyncio

import pytest

from fleet import NotReady, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet.model.report import GpsReport, PoseReport, TelemetryReport

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
WHY = {"ardupilot": "EKF Failsafe: changed to LAND Mode", "px4": "Failsafe activated"}


@both
def test_it_is_reported_marked_and_ended_in_the_air(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            await asyncio.sleep(2.0)
            began = it.now
            it.sim.set_fault("gps_loss", 1)
            await it.until(lambda: "no satellite fix" in it.robot.healths[-1].cause, within=3.0)
            gps = [each for each in it.robot.reports if isinstance(each, GpsReport)]
            assert (gps[-1].fix_type, gps[-1].point) in {("none", None), (gps[0].fix_type, gps[-1].point)}
            await it.until(lambda: it.robot.losses, within=12.0)
            assert WHY[flavour] in it.robot.losses[-1]
            await it.until(lambda: it.state.estimator_has_position is False, within=3.0)
            it.robot.reports.clear()
            await asyncio.sleep(3.0)
            assert not any(isinstance(each, PoseReport) for each in it.robot.reports)
            gps = [each for each in it.robot.reports if isinstance(each, GpsReport)]
            assert gps
            assert all((each.fix_type, each.point) == ("none", None) for each in gps)
            fields = [each for each in it.robot.reports if isinstance(each, TelemetryReport)][-1].fields
            assert fields["gps_fix"] == "none"
            assert fields["position_usable"] is False
            health = it.robot.healths[-1]
            assert health.level is Level.DEGRADED
            assert WHY[flavour] in health.cause
            assert "not reliable" in health.cause
            assert it.now - began < 20.0

    run_in_sim_time(main())


@both
def test_the_reason_of_the_fail_safe_is_in_what_is_refused(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=15.0)
            it.sim.set_fault("gps_loss", 1)
            await it.until(lambda: it.robot.losses, within=12.0)
            with pytest.raises(NotReady, match=WHY[flavour]):
                it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
            with pytest.raises((Refused, NotReady), match=r"requires position|not available"):
                await it.adapter.stop("hover")

    run_in_sim_time(main())


@both
def test_a_climb_that_a_fail_safe_ends_says_why(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            climbing = asyncio.ensure_future(it.do("takeoff", altitude=60.0))
            await it.until(lambda: it.height > 2.0)
            it.sim.set_fault("gps_loss", 1)
            with pytest.raises(CommandError, match=r"taken over|superseded"):
                await climbing
            await it.until(lambda: it.robot.losses, within=3.0)
            assert WHY[flavour] in it.robot.losses[-1]

    run_in_sim_time(main())


@both
def test_with_satellites_again_all_of_it_is_over(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=20.0)
            it.sim.set_fault("gps_loss", 1)
            await it.until(lambda: it.robot.losses, within=12.0)
            it.sim.set_fault("gps_loss", None)
            await it.until(lambda: it.robot.healths[-1].level is Level.OK, within=6.0)
            it.robot.reports.clear()
            await asyncio.sleep(2.0)
            assert any(isinstance(each, PoseReport) for each in it.robot.reports)

    run_in_sim_time(main())


def test_an_autopilot_without_satellites_from_the_start_is_no_loss(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", ready=None) as it:
            await asyncio.sleep(9.0)
            assert it.robot.healths[-1].level is Level.OK

    run_in_sim_time(main())
