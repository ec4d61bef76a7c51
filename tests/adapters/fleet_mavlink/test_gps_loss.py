"""A lost position: told in words, and what is not to be trusted ends; recorded and simulated."""

import asyncio
import contextlib

import pytest

from fleet import NotReady, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet.model.report import GpsReport, PoseReport, TelemetryReport
from fleet.testing.clock import ManualClock
from fleet_mavlink.failsafe_causes import FailsafeCause, cause, position_troubles
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.texts import Sentence

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
WHY = {"ardupilot": "EKF Failsafe: changed to LAND Mode", "px4": "Failsafe activated"}


class Silent:
    """A link on which nothing is written."""

    url = "replay"


def causes_of(records):
    """Return (seconds, cause or troubles) of a recording, each when it is new."""
    clock, found = ManualClock(monotonic=0.0), []
    hub, failsafe = LinkHub(Silent(), clock, 255, 190), FailsafeCause()
    with contextlib.ExitStack() as claims:
        vehicle = claims.enter_context(hub.vehicle(1))
        began, looked = None, 0.0
        for stamp, frame in records:
            began = stamp if began is None else began
            clock.advance(max(0.0, stamp - began - clock.monotonic()))
            hub.receive(frame, None)
            now = clock.monotonic()
            if vehicle.kind is None or now - looked < 0.1:
                continue
            looked = now
            failsafe.observe(vehicle.state, vehicle.kind.mode_of(vehicle.state), vehicle.sentences, now)
            causes = (failsafe.text, *position_troubles(vehicle.state, now))
            if not found or found[-1][1] != causes:
                found.append((round(now, 1), causes))
    return found


def test_a_copters_loss_is_reported_within_a_second_and_its_fail_safe_with_its_reason(recording):
    causes = causes_of(recording("ap_copter_gps_loss"))
    first = next(at for at, (_, *troubles) in causes if troubles)
    assert first == pytest.approx(58.4, abs=1.0), "the receiver was switched off at 57.6"
    at, words = next((at, words) for at, words in causes if len(words) == 3)
    assert at == pytest.approx(65.6, abs=0.3)
    assert words[1] == "no satellite fix (3 satellites)"
    assert "its estimator lost horizontal velocity, position" in words[2]
    reasons = {words[0] for _, words in causes} - {""}
    assert any("EKF variance; EKF Failsafe: changed to LAND Mode" in each for each in reasons)
    assert not any("Cleared" in each for each in reasons)
    assert causes[-1][1] == ("",), "it is over at the end"


def test_px4s_loss_is_reported_within_a_second(recording):
    causes = causes_of(recording("px4_gps_loss"))
    first = next(at for at, (_, *troubles) in causes if troubles)
    assert first == pytest.approx(19.2, abs=1.0), "the receiver was switched off at 18.8"
    assert any("Failsafe activated" in words[0] for _, words in causes)
    assert any("its estimator lost" in words[-1] for _, words in causes)
    assert causes[-1][1] == ("",)


def test_each_step_of_a_battery_fail_safe_has_its_own_reason(recording):
    reasons = [words[0] for _, words in causes_of(recording("px4_battery_low")) if words[0]]
    assert "Critical battery" in reasons[0]
    assert any("Emergency battery level" in each for each in reasons)


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


def test_what_is_over_and_what_another_says_better_is_no_cause():
    said = [
        Sentence("EKF Failsafe Cleared", 2, 1.0),
        Sentence("EKF3 lane switch 1", 2, 1.0),
        Sentence("Failsafe activated", 2, 1.1),
        Sentence("Failsafe activated: entering Hold for 5 seconds", 2, 1.2),
        Sentence("Switching to Hold is currently not available", 2, 1.3),
        Sentence("Landing at current position", 6, 1.3),
    ]
    assert cause(said, 0.0, 2.0) == "Failsafe activated: entering Hold for 5 seconds"
    assert cause(said, 5.0, 9.0) == ""
