"""What the autopilot does by itself, verified and set; and a vehicle whose edge is gone."""

import asyncio

import pytest

from fleet import Goal, GoTo, Refused, Vector3
from fleet.model.health import Level
from fleet_mavlink.failsafes import rules_for
from fleet_mavlink.sim.params import decode

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
PARAMETER = {"ardupilot": "FS_GCS_ENABLE", "px4": "NAV_DLL_ACT"}


async def flown(steps):
    """Let a goal be flown for as long as it goes."""
    async for _ in steps:
        pass


@both
def test_what_is_wrong_is_reported_as_health_and_not_touched(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, failsafes="check") as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.healths[-1].level is Level.DEGRADED, within=10.0)
            assert (
                f"{PARAMETER[flavour]} is 0: it flies on when the edge is lost" in it.robot.healths[-1].cause
            )
            assert it.sim.pilot.params[PARAMETER[flavour]] == 0

    run_in_sim_time(main())


@both
def test_it_is_set_where_fleet_yaml_says_so_and_again_after_a_reboot(
    run_in_sim_time, sim_flight, flavour, caplog
):
    async def main():
        async with sim_flight(flavour, failsafes="set") as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params[PARAMETER[flavour]] > 0, within=10.0)
            await it.until(lambda: it.robot.healths[-1].level is Level.OK, within=10.0)
            await asyncio.sleep(5)
            it.sim.pilot.params._values[PARAMETER[flavour]] = (2, 0.0)
            it.sim.set_fault("reboot", 1.0)
            await it.until(lambda: it.sim.pilot.params[PARAMETER[flavour]] > 0, within=30.0)
            records = [
                each for each in caplog.records if f"fail-safe {PARAMETER[flavour]} was" in each.getMessage()
            ]
            assert {each.name for each in records} == {it.robot.log.name}, "whose parameter it is"

    run_in_sim_time(main())


@both
def test_a_command_sets_it_but_not_with_the_motors_running(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, failsafes="check", link_loss="land") as it:
            await it.wait_until_known()
            await it.do("arm")
            with pytest.raises(Refused, match="armed"):
                await it.do("set_failsafes")
            await it.do("disarm")
            await it.do("set_failsafes")
            assert it.sim.pilot.params[PARAMETER[flavour]] == {"ardupilot": 5, "px4": 3}[flavour]
            await it.until(lambda: it.robot.healths[-1].level is Level.OK, within=10.0)

    run_in_sim_time(main())


@pytest.mark.parametrize(("link_loss", "mode"), [("return_to_home", "RTL"), ("land", "LAND")])
@both
def test_a_vehicle_whose_edge_dies_on_the_way_to_a_goal_saves_itself(
    run_in_sim_time, sim_flight, flavour, link_loss, mode
):
    async def main():
        async with sim_flight(flavour, failsafes="set", link_loss=link_loss) as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params[PARAMETER[flavour]] > 0, within=10.0)
            await it.do("takeoff", altitude=10.0)
            going = asyncio.ensure_future(
                flown(it.adapter.navigate(GoTo(Goal(position=Vector3(0.0, 900.0, 10.0)))))
            )
            await it.until(lambda: it.place[0] > 10.0, within=20.0)
            it.radio = False
            await it.until(lambda: it.mode == mode, within=20.0)
            await it.until(lambda: not it.armed, within=200.0)
            assert abs(it.place[0]) < 2.0 or mode == "LAND"
            going.cancel()
            await asyncio.gather(going, return_exceptions=True)

    run_in_sim_time(main())


@both
def test_after_the_fail_safe_a_new_command_is_needed(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, failsafes="set") as it:
            await it.wait_until_known()
            await it.until(lambda: it.sim.pilot.params[PARAMETER[flavour]] > 0, within=10.0)
            await it.do("takeoff", altitude=20.0)
            it.radio = False
            await it.until(lambda: it.mode == "RTL", within=20.0)
            it.radio = True
            await it.until(lambda: it.robot.losses, within=20.0)
            await it.until(lambda: it.adapter._session.vehicle.connected, within=5.0)
            assert it.mode == "RTL"
            await it.do("cancel_return_to_home")
            assert it.mode in {"BRAKE", "LOITER"}

    run_in_sim_time(main())


def test_other_names_of_newer_firmware_are_known():
    (watched,) = [
        rule for rule in rules_for("ardupilot", "land", 245, receiver=True) if "MAV_GCS_SYSID" in rule.names
    ]
    assert watched.good == {245}
    assert decode(6, 245.0, "cast") in watched.good


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_vehicle_that_may_fly_on_is_not_asked_to_watch_us(flavour):
    names = {name for rule in rules_for(flavour, "continue", 245, receiver=True) for name in rule.names}
    assert not names & {"FS_GCS_ENABLE", "SYSID_MYGCS", "NAV_DLL_ACT"}
