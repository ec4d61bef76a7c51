"""Stops of a VTOL while it goes over to its wings, and before it has told how it flies."""

import asyncio
import math

import pytest

from fleet import GeoPoint, Goal, GoTo, Refused, Vector3
from fleet_mavlink.ardupilot_plane import arduplane_of
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4_plane import px4_plane_of
from fleet_mavlink.sim.wire import MavlinkWire
from fleet_mavlink.state import VehicleState

TO_FORWARD, TO_HOVER, HOVERS, FORWARD = 1, 2, 3, 4  # MAV_VTOL_STATE
NUMBERS = {"AUTO": 10, "LOITER": 12, "GUIDED": 15, "QLOITER": 19}
HEIGHT = 40.0  # m
HERE = GeoPoint(47.397742, 8.545594, 528.0)
EAST = Vector3(0.0, 8.0, 0.0)  # m/s, NED
flavours = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


async def hovering(it):
    """Meet a VTOL, set it up, and take it to its height."""
    await it.wait_until_known()
    if "ardupilot" in it.sim.flavour:
        await it.until(lambda: "Q_GUIDED_MODE" in it.state.settings)
        await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
        await it.until(lambda: "takeoff" not in it.robot.lacking)
    await it.until(lambda: "WP_LOITER_RAD" in it.state.settings or "NAV_LOITER_RAD" in it.state.settings)
    await it.do("takeoff", altitude=HEIGHT)
    return it


async def goes_over(it):
    """Begin a transition; return the command that waits for its end."""
    going = asyncio.ensure_future(it.do("transition", to="forward"))
    await it.until(lambda: it.sim.pilot.vtol_state() == TO_FORWARD)
    await it.until(lambda: it.speed > 4.0)
    return going


async def stands(it):
    """See it stand in its hover, and go on standing there; return how long it took."""
    seconds = await it.until(lambda: it.speed < 0.5, 20.0)
    for _ in range(200):
        assert it.sim.pilot.vtol_state() in {TO_HOVER, HOVERS}
        await asyncio.sleep(0.05)
    assert it.speed < 0.5
    return seconds


@pytest.mark.combinations
@flavours
@pytest.mark.parametrize("reason", ["stop", "hover", "emergency_stop"])
def test_a_stop_breaks_a_transition_off_and_the_vtol_hovers(run_in_sim_time, sim_flight, flavour, reason):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            going = await goes_over(await hovering(it))
            height = it.height
            await it.adapter.stop(reason)
            with pytest.raises(Refused):
                await going
            await stands(it)
            assert it.height == pytest.approx(height, abs=3.0)
            assert it.robot.losses == []

    run_in_sim_time(main())


@pytest.mark.parametrize("reason", ["stop", "emergency_stop"])
def test_a_quadplane_that_is_stopped_on_the_way_back_to_its_hover_is_not_flown_past_its_target_and_back(
    run_in_sim_time, sim_flight, reason
):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            await it.do("transition", to="forward")
            await it.until(lambda: it.speed > 20.0)
            going = asyncio.ensure_future(it.do("transition", to="hover"))
            await it.until(lambda: it.state.vtol_state == TO_HOVER, 10.0)
            began, farthest = it.place, 0.0
            await it.adapter.stop(reason)
            going.cancel()
            for _ in range(800):
                farthest = max(farthest, math.dist(began, it.place))
                await asyncio.sleep(0.05)
            await stands(it)
            assert math.dist(began, it.place) > farthest - 5.0, "it flew back"
            assert not it.adapter._session.health.unstopped

    run_in_sim_time(main())


@flavours
def test_a_halt_from_another_thread_breaks_a_transition_off(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            going = await goes_over(await hovering(it))
            await asyncio.to_thread(it.adapter.emergency_halt)
            await stands(it)
            with pytest.raises(Refused):
                await going

    run_in_sim_time(main())


def test_a_stop_on_the_way_to_a_far_goal_breaks_its_transition_off(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            task = GoTo(Goal(position=Vector3(0.0, 900.0, HEIGHT)))
            going = asyncio.ensure_future(anext(aiter(it.adapter.navigate(task))))
            await it.until(lambda: it.sim.pilot.vtol_state() == TO_FORWARD)
            await it.until(lambda: it.speed > 4.0)
            await it.adapter.stop("stop")
            await stands(it)
            going.cancel()

    run_in_sim_time(main())


def test_a_transition_that_does_not_end_fails_the_stop(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", vehicle="vtol", limits={"speed": 30.0}) as it:
            going = await goes_over(await hovering(it))
            it.sim.pilot.commands = {
                **it.sim.pilot.commands,
                MavCmd.DO_VTOL_TRANSITION: lambda _pilot, _request: 4,
            }
            with pytest.raises(Exception, match="not seen to hover again"):
                await it.adapter.stop("emergency_stop")
            going.cancel()

    run_in_sim_time(main())


@flavours
def test_a_stop_on_its_wings_leaves_it_there(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            await it.do("transition", to="forward")
            await it.adapter.stop("emergency_stop")
            await asyncio.sleep(10.0)
            assert it.sim.pilot.vtol_state() == FORWARD

    run_in_sim_time(main())


@flavours
def test_the_first_stop_after_a_reconnect_leaves_a_hovering_vtol_hovering(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as before:
            await hovering(before)
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            it.sim, it.wire = before.sim, MavlinkWire(before.sim, ())
            it._origin -= before.sim.time
            await it.until(lambda: it.robot.is_connected)
            await it.until(lambda: it.state.heartbeat is not None)
            assert flavour == "px4" or it.state.vtol_state is None
            await it.adapter.stop("stop")
            await stands(it)

    run_in_sim_time(main())


def test_an_emergency_stop_of_a_quadplane_that_is_not_heard_does_not_fly_it_back(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            task = GoTo(Goal(position=Vector3(0.0, 120.0, HEIGHT)))
            going = asyncio.ensure_future(anext(aiter(it.adapter.navigate(task))))
            await it.until(lambda: it.speed > 4.0)
            it.mute = True
            await asyncio.sleep(8.0)
            north, _, _ = it.place
            await asyncio.to_thread(it.adapter.emergency_halt)
            for _ in range(300):
                assert it.place[0] > north - 1.0, "it flies back to where it was heard last"
                await asyncio.sleep(0.05)
            assert it.speed < 0.5
            going.cancel()

    run_in_sim_time(main())


def test_a_silence_makes_unknown_how_a_vtol_flies(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            it.radio = False
            await asyncio.sleep(5.0)
            it.radio = True
            await it.until(lambda: it.state.heartbeat_at > it.robot.clock.monotonic() - 1.0)
            assert it.state.vtol_state is None
            await it.until(lambda: it.state.vtol_state == HOVERS, 3.0)

    run_in_sim_time(main())


def seen(mode, vtol=None, *, here=True, **settings):
    """Return the state of an armed ArduPlane in a mode."""
    return VehicleState(
        heartbeat=Heartbeat(1, 3, 0x80, NUMBERS[mode], 4),
        heartbeat_at=10.0,
        vtol_state=vtol,
        position=HERE if here else None,
        position_at=10.0,
        velocity=EAST,
        settings=settings,
    )


def orders(state):
    """Return what is sent by the best stop: the command, and the mode or the place."""
    return [
        (
            MavCmd(request.command).name,
            request.param2 if request.command == MavCmd.DO_SET_MODE else round(request.z),
        )
        for request in arduplane_of(state).holding(state).requests
    ]


@pytest.mark.parametrize(
    ("state", "sent"),
    [
        (seen("LOITER"), [("DO_SET_MODE", 15.0)]),
        (seen("AUTO", here=False), [("DO_SET_MODE", 15.0)]),
        (seen("GUIDED"), [("DO_REPOSITION", 528)]),
        (seen("GUIDED", here=False), [("DO_SET_MODE", 12.0), ("DO_SET_MODE", 15.0)]),
        (seen("QLOITER"), [("DO_SET_MODE", 20.0)]),
        (seen("QLOITER", Q_GUIDED_MODE=1.0), [("DO_SET_MODE", 15.0)]),
        (seen("GUIDED", HOVERS), [("DO_REPOSITION", 528)]),
        (seen("QLOITER", HOVERS), [("DO_SET_MODE", 20.0)]),
        (seen("GUIDED", HOVERS, Q_GUIDED_MODE=0.0), [("DO_SET_MODE", 20.0)]),
        (seen("LOITER", TO_FORWARD, Q_GUIDED_MODE=1.0), [("DO_REPOSITION", 528)]),
        (seen("LOITER", TO_FORWARD), [("DO_SET_MODE", 20.0)]),
        (seen("GUIDED", FORWARD), [("DO_SET_MODE", 12.0)]),
        (seen("GUIDED", 0), [("DO_SET_MODE", 12.0)]),
    ],
)
def test_a_stop_of_an_arduplane_is_the_one_for_what_is_known_of_it(state, sent):
    assert orders(state) == sent


def test_a_px4_vtol_is_called_back_to_its_hover_first():
    state = VehicleState(vtol_state=TO_FORWARD)
    back, hold = px4_plane_of(22, state).holding(state).requests
    assert (back.command, back.param1) == (MavCmd.DO_VTOL_TRANSITION, 3.0)
    assert hold.command == MavCmd.DO_REPOSITION


@pytest.mark.combinations
@flavours
@pytest.mark.parametrize("lag", [0.0, 0.7])
def test_a_transition_that_is_asked_for_right_after_the_opposite_one_is_carried_out(
    run_in_sim_time, sim_flight, flavour, lag
):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            it.sim.set_fault("state_lag", lag)
            going = asyncio.ensure_future(it.do("transition", to="forward"))
            await it.until(lambda: it.sim.pilot.vtol_state() == TO_FORWARD)
            assert it.state.vtol_state == HOVERS
            going.cancel()
            await it.do("transition", to="hover")
            await asyncio.sleep(8.0)
            assert it.sim.pilot.vtol_state() == HOVERS

    run_in_sim_time(main())


@flavours
def test_a_transition_to_what_it_flies_ends_the_flight_that_the_host_has_ended(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            await hovering(it)
            way = it.adapter.navigate(GoTo(Goal(Vector3(60.0, 0.0, HEIGHT))))
            await anext(way)
            await it.until(lambda: it.speed > 2.0)
            await way.aclose()
            await it.do("transition", to="hover")
            await it.until(lambda: it.speed < 0.5, within=8.0)
            assert it.place[1] < 45.0

    run_in_sim_time(main())
