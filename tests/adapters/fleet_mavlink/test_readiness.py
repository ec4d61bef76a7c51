"""Readiness as the autopilot means it, as a list of checks."""

import asyncio
import contextlib

import pytest

from fleet import Refused
from fleet.errors import CommandError
from fleet_mavlink.readiness import reasons
from fleet_mavlink.statustext import Sentence

WORDS = {
    "ardupilot": "PreArm: Need Position Estimate",
    "px4": "Preflight Fail: Resolve system health failures first",
}
both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


def failed(answer):
    return {each["check"] for each in answer["checks"] if each["ok"] is not True}


@both
def test_a_vehicle_that_can_take_off_is_ready(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.prearm_ok and it.state.fix)
            answer = await it.do("check_ready")
            assert answer["ready"]
            assert failed(answer) == set()
            await it.do("takeoff")

    run_in_sim_time(main())


def test_ardupilot_tells_what_it_waits_for(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", ready=None) as it:
            await it.until(lambda: it.now > 30.0)
            answer = await it.do("check_ready")
            assert not answer["ready"]
            assert "position" in failed(answer)
            await it.until(lambda: it.now > 45.0)
            assert (await it.do("check_ready"))["ready"]

    run_in_sim_time(main())


@both
def test_the_autopilots_own_words_stand_beside_its_checks(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, faults={"not_ready": 1.0}) as it:
            await it.until(lambda: it.robot.is_connected and it.state.prearm_ok is not None)
            with contextlib.suppress(CommandError):
                await it.do("arm")  # brings ArduPilot into GUIDED, in which it checks the position
            await asyncio.sleep(2.0)
            answer = await it.do("check_ready")
            (own,) = (each for each in answer["checks"] if each["check"] == "autopilot's own checks")
            assert not answer["ready"]
            assert own["ok"] is False
            assert own["words"][-1] == WORDS[flavour]

    run_in_sim_time(main())


async def refused_for_its_log(it):
    """Let it find that its log does not open; its bit does not show it yet."""
    await it.wait_until_known()
    await it.until(lambda: it.state.prearm_ok and it.state.fix)
    it.sim.set_fault("log_fails", 1.0)
    assert (await it.do("check_ready"))["ready"], "it looks at its log only when it is armed"
    with pytest.raises(Refused, match="Arm: Logging not started"):
        await it.do("arm")


def own_of(answer):
    (own,) = (each for each in answer["checks"] if each["check"] == "autopilot's own checks")
    return own["words"]


@pytest.mark.parametrize("vehicle", ["plane", "rover", "multirotor"])
def test_what_ardupilot_says_counts_before_its_bit_shows_it(run_in_sim_time, sim_flight, vehicle):
    async def main():
        async with sim_flight("ardupilot", vehicle=vehicle) as it:
            await refused_for_its_log(it)
            assert it.state.prearm_ok
            answer = await it.do("check_ready")
            assert own_of(answer) == ["Arm: Logging not started", "PreArm: Logging failed"]
            assert not answer["ready"]

    run_in_sim_time(main())


def test_an_arming_that_was_refused_is_reported_though_the_checks_find_nothing(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="plane") as it:
            await refused_for_its_log(it)
            await asyncio.sleep(8.0)
            assert it.state.prearm_ok
            answer = await it.do("check_ready")
            assert own_of(answer) == ["Arm: Logging not started"]
            assert not answer["ready"]
            await asyncio.sleep(30.0)
            assert (await it.do("check_ready"))["ready"], "nobody knows"

    run_in_sim_time(main())


def test_a_refusal_that_the_checks_would_find_again_is_over_when_they_do_not(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", faults={"not_ready": 1.0}) as it:
            await it.until(lambda: it.robot.is_connected and it.state.prearm_ok is not None)
            with pytest.raises(Refused, match="Arm: Need Position Estimate"):
                await it.do("arm")
            answer = await it.do("check_ready")
            assert own_of(answer) == ["PreArm: Need Position Estimate"]
            assert not answer["ready"]
            it.sim.set_fault("not_ready", None)
            await asyncio.sleep(3.0)
            assert (await it.do("check_ready"))["ready"]

    run_in_sim_time(main())


@pytest.mark.parametrize("vehicle", ["multirotor", "vtol"])
def test_a_mode_that_it_is_not_armed_in_is_left_by_a_takeoff(run_in_sim_time, sim_flight, vehicle):
    async def main():
        async with sim_flight("ardupilot", vehicle=vehicle, limits={"speed": 30.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: vehicle == "multirotor" or "Q_GUIDED_MODE" in it.state.settings)
            if vehicle == "vtol":
                await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
            await it.do("takeoff", altitude=20.0)
            await it.do("land")
            await it.until(lambda: it.state.prearm_ok is False, within=3.0)
            answer = await it.do("check_ready")
            assert answer["ready"], failed(answer)
            await it.do("takeoff", altitude=20.0)

    run_in_sim_time(main())


@both
def test_what_has_just_lost_its_satellites_is_not_ready(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.prearm_ok and it.state.fix)
            it.sim.set_fault("gps_loss", 1.0)
            await it.until(lambda: it.state.fix is None, within=3.0)
            answer = await it.do("check_ready")
            assert failed(answer) == {"satellites"}, "the estimator loses its position some seconds later"
            assert answer["checks"][0]["words"][0].startswith("no satellite fix")
            assert not answer["ready"]

    run_in_sim_time(main())


def test_what_is_armed_is_not_asked(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("arm")
            with pytest.raises(Refused, match="armed"):
                await it.do("check_ready")

    run_in_sim_time(main())


def test_reasons_are_reported_once_and_not_for_ever():
    said = [
        Sentence("PreArm: GPS 1: Bad fix", 2, 10.0),
        Sentence("PreArm: Need Position Estimate", 2, 60.0),
        Sentence("EKF3 IMU0 origin set", 6, 61.0),
        Sentence("PreArm: Need Position Estimate", 2, 90.0),
    ]
    assert reasons(said, 92.0) == ("PreArm: Need Position Estimate",)
