"""The remote control lost while the adapter flies: told, left to the autopilot, taken back by a command."""

import asyncio
import contextlib

import pytest

from fleet import Goal, GoTo, NotReady, Refused, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet_mavlink.failsafes import rules_for

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
SAID = {"ardupilot": "Radio Failsafe", "px4": "Failsafe activated"}
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}


@contextlib.asynccontextmanager
async def in_the_air(sim_flight, flavour, **config):
    """Fly a vehicle that has a remote control, at 10 m."""
    async with sim_flight(flavour, **config) as it:
        await it.wait_until_known()
        if flavour == "px4":
            await it.do("set_parameter", name="COM_RC_IN_MODE", value=0)
        await it.do("takeoff", altitude=10.0)
        yield it


@both
def test_a_velocity_ends_and_the_loss_is_reported_in_the_autopilots_words(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with in_the_air(sim_flight, flavour) as it:
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            it.sim.set_fault("rc_loss", 1.0)
            with pytest.raises((Refused, NotReady), match="a pilot or a fail-safe has it"):
                await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 5.0)
            (reason,) = it.robot.losses
            assert f"not by us: its own fail-safe ({SAID[flavour]}" in reason
            assert it.robot.healths[-1].level is Level.DEGRADED
            cause = it.robot.healths[-1].cause
            assert cause.startswith(f"the autopilot is in a fail-safe: {SAID[flavour]}")
            streamed = len(it.setpoints)
            await it.until(lambda: it.mode == "RTL", within=10.0)
            await it.until(lambda: not it.armed, within=120.0)
            assert len(it.setpoints) == streamed

    run_in_sim_time(main())


@both
def test_a_goal_fails_and_the_vehicle_is_left_to_itself(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with in_the_air(sim_flight, flavour) as it:
            it.sim.set_fault("rc_loss", 1.0)
            requested = len(it.commands)
            with pytest.raises(CommandError):
                async for _ in it.adapter.navigate(GoTo(Goal(position=Vector3(0.0, 300.0, 10.0)))):
                    pass
            await it.until(lambda: not it.armed, within=180.0)
            assert abs(it.place[0]) < 2.0
            assert (
                len([each for each in it.commands[requested:] if each.command != 511]) <= 2
            )  # the goal's own

    run_in_sim_time(main())


@both
def test_hover_takes_it_back_while_the_control_is_lost(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with in_the_air(sim_flight, flavour) as it:
            it.sim.set_fault("rc_loss", 1.0)
            await it.until(lambda: it.mode == "RTL" and it.robot.losses, within=15.0)
            await it.adapter.stop("hover")
            assert it.mode == HOLD[flavour]
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 3.0)
            assert it.speed > 0.5
            assert len(it.robot.losses) == 1

    run_in_sim_time(main())


@both
def test_a_flight_home_goes_on(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with in_the_air(sim_flight, flavour) as it:
            home = asyncio.ensure_future(it.do("return_to_home"))
            await it.until(lambda: it.mode == "RTL")
            it.sim.set_fault("rc_loss", 1.0)
            await home
            assert not it.armed
            assert it.robot.losses == []

    run_in_sim_time(main())


def test_ardupilot_on_the_ground_says_why_it_does_not_take_off(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", faults={"rc_loss": 1.0}) as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="Radio failsafe on"):
                await it.do("takeoff")
            answer = await it.do("check_ready")
            (control,) = (each for each in answer["checks"] if each["check"] == "remote control")
            assert not answer["ready"]
            assert (control["ok"], tuple(control["words"])) == (False, ("no signal from it is received",))

    run_in_sim_time(main())


def test_a_vehicle_without_a_receiver_is_not_asked_for_a_remote_control(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", faults={"rc_loss": 1.0}) as it:
            await it.wait_until_known()
            answer = await it.do("check_ready")
            assert "remote control" not in {each["check"] for each in answer["checks"]}
            await it.do("takeoff")

    run_in_sim_time(main())


@pytest.mark.parametrize(("flavour", "name"), [("ardupilot", "FS_THR_ENABLE"), ("px4", "NAV_RCL_ACT")])
def test_its_fail_safe_is_verified_where_there_is_a_receiver(flavour, name):
    def names(receiver):
        return {each.names[0] for each in rules_for(flavour, "continue", 245, receiver=receiver)}

    assert names(receiver=True) - names(receiver=False) == {name}


def test_a_remote_control_whose_loss_does_nothing_is_reported(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", failsafes="check") as it:
            it.sim.pilot.params._values["FS_THR_ENABLE"] = (2, 0.0)
            await it.wait_until_known()
            wrong = "FS_THR_ENABLE is 0: it flies on when the remote control is lost"
            await it.until(lambda: wrong in it.robot.healths[-1].cause, within=10.0)

    run_in_sim_time(main())
