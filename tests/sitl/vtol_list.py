"""What every VTOL is flown through: in its hover, over to its wings and back, home.

A step is a coroutine that takes ``it``: the adapter on a link, ``planes``: the list of planes.
"""

from __future__ import annotations

import asyncio
import contextlib

import msgspec
import pytest

from fleet import (
    FlyMission,
    GeoPoint,
    Goal,
    GoTo,
    NotReady,
    PlanItem,
    Unsupported,
    Vector3,
    Velocity,
)
from fleet.errors import CommandError
from fleet.model.navigation import Constraints
from fleet_mavlink.constants import ARDUPILOT

LONG = 300.0  # s
HEIGHT = 30.0  # m
GOES_OVER, SLOWS, HOVERS, FLIES_FORWARD = 1, 2, 3, 4
FAR = 40.0  # m; to a place much farther off a QuadPlane flies on its wings
SINKS = 3.0  # m of height that a hold in the hover may lose


async def exhausted(steps):
    return [step async for step in steps]


def is_arduplane(it):
    return it.state.heartbeat.autopilot == ARDUPILOT


async def is_set_up(it, planes):
    """Meet it on the ground; a QuadPlane whose GUIDED does not hover is not moved until it is set up."""
    await it.until(lambda: it.robot.is_connected and it.state.home_altitude is not None, LONG)
    await it.until(lambda: it.state.vtol_state != 0, LONG)
    if is_arduplane(it):
        await it.until(lambda: "Q_GUIDED_MODE" in it.state.settings, LONG)
        await it.do("set_parameter", name="Q_GUIDED_MODE", value=0)
        await it.until(lambda: "takeoff" in it.robot.lacking, LONG)
        with pytest.raises(Unsupported, match="Q_GUIDED_MODE 1"):
            await it.do("takeoff", altitude=HEIGHT)
        await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
        await it.until(lambda: "takeoff" not in it.robot.lacking, LONG)
    await planes.is_met_and_ready(it)
    with pytest.raises(NotReady):
        await it.do("transition", to="forward")


async def takes_off_with_its_rotors(it, planes):
    await it.do("takeoff", altitude=HEIGHT)
    assert it.state.vtol_state == HOVERS
    assert abs(it.state.relative_altitude - HEIGHT) < SINKS
    assert planes.speed(it) < 1.0
    await asyncio.sleep(5.0)
    assert abs(it.state.relative_altitude - HEIGHT) < SINKS
    assert planes.speed(it) < 1.0


async def is_stopped_in_its_hover(it, planes):
    """Send it away, and stop it by each word: it stands, and does not sink."""
    for reason, east in (("stop", FAR), ("emergency_stop", -FAR), ("hover", FAR)):
        away, _ = planes.place(it, east, 0.0, HEIGHT)
        going = asyncio.ensure_future(exhausted(it.adapter.navigate(GoTo(Goal(position=away)))))
        await it.until(lambda: planes.speed(it) > 2.0, LONG)
        assert it.state.vtol_state in {SLOWS, HOVERS}
        await it.adapter.stop(reason)
        assert planes.mode(it) == planes.flavour(it).hold
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)
        height, began = it.state.relative_altitude, planes.session(it).vehicle.now()
        await it.until(lambda: planes.speed(it) < 1.0, 30.0)
        while planes.session(it).vehicle.now() - began < 20.0:
            assert abs(it.state.relative_altitude - height) < SINKS
            await asyncio.sleep(0.5)
        assert planes.speed(it) < 1.0, "it stands, where it came to stand or where the stop began"


@contextlib.asynccontextmanager
async def sent_far(it, planes, east):
    """Send it to a place in its hover, and let it get fast."""
    far, _ = planes.place(it, east, 0.0, HEIGHT)
    going = asyncio.ensure_future(exhausted(it.adapter.navigate(GoTo(Goal(position=far)))))
    await it.until(lambda: planes.speed(it) > 2.0, LONG)
    try:
        yield
    finally:
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)


async def comes_to_stand(it, planes, height, where, within=60.0):
    """See it come to stand in its hover near a place (``within`` m), at its height, and stay there."""
    await it.until(lambda: planes.speed(it) < 1.0 and it.state.vtol_state == HOVERS, 40.0)
    for _ in range(20):
        assert abs(it.state.relative_altitude - height) < 2 * SINKS
        assert planes.away(it, where) < within
        await asyncio.sleep(0.5)
    assert planes.speed(it) < 1.0


async def is_stopped_first_when_its_link_is_back(it, planes):
    """Lose it on its way; the first that it hears again is the stop of the host."""
    async with sent_far(it, planes, 120.0):
        with planes.silence(it):
            await asyncio.sleep(5.0)
        await it.until(lambda: planes.session(it).vehicle.connected, 10.0)
        where, height = it.state.position, it.state.relative_altitude
        await it.adapter.stop("it was lost while it moved")
        await comes_to_stand(it, planes, height, where)


async def is_stopped_while_it_is_not_heard(it, planes):
    """Hear nothing of it on its way, and set the emergency stop: it stands, and is not flown back."""
    async with sent_far(it, planes, -60.0):
        with planes.silence(it, both_directions=False):
            await asyncio.sleep(5.0)
            await asyncio.to_thread(it.adapter.emergency_halt)
            await asyncio.sleep(3.0)
        await it.until(lambda: planes.session(it).vehicle.connected, 10.0)
        await comes_to_stand(it, planes, it.state.relative_altitude, it.state.position)
    _, there = planes.place(it, -60.0, 0.0)
    assert planes.away(it, there) > 20.0, "it flew on"
    await it.adapter.stop("hover")


async def goes_to_a_place_in_its_hover(it, planes):
    position, there = planes.place(it, 20.0, 20.0, HEIGHT)
    steps = await exhausted(it.adapter.navigate(GoTo(Goal(position=position))))
    assert steps[-1].percent == 100.0
    assert planes.away(it, there) < 3.0
    assert it.state.vtol_state == HOVERS


async def is_stopped_on_the_way_to_its_wings(it, planes):
    """Break a transition off, early and late: it hovers, where it came to stand, at its height."""
    for reason, fast in (("stop", 2.0), ("emergency_stop", 5.0)):
        going = asyncio.ensure_future(it.do("transition", to="forward"))
        await it.until(lambda fast=fast: it.state.vtol_state == GOES_OVER and planes.speed(it) > fast, LONG)
        where, height = it.state.position, it.state.relative_altitude
        await it.adapter.stop(reason)
        assert it.state.vtol_state in {SLOWS, HOVERS}
        with pytest.raises(CommandError):
            await going
        await it.until(lambda: planes.speed(it) < 1.0, 30.0)
        assert planes.away(it, where) < 60.0
        assert abs(it.state.relative_altitude - height) < 2 * SINKS
        await asyncio.sleep(10.0)
        assert planes.speed(it) < 1.0
        assert it.state.vtol_state == HOVERS


def forget_how_guided_flies(it, planes):
    """Let it be unknown, as when the answer was lost each time."""
    vehicle = planes.session(it).vehicle
    known = {name: value for name, value in it.state.settings.items() if name != "Q_GUIDED_MODE"}
    vehicle.state = msgspec.structs.replace(vehicle.state, settings=known)


async def is_stopped_without_knowing_how_guided_flies(it, planes):
    """Stop a QuadPlane in its hover, where it is seen to stand in GUIDED, and on the way to its wings: QLAND.

    After a transition that was broken off ArduPlane begins another one to a place of 40 m away.
    """
    if not is_arduplane(it):
        return
    for far in (FAR, -FAR):
        await it.until(lambda: planes.speed(it) < 1.0 and it.state.vtol_state == HOVERS, 40.0)
        async with sent_far(it, planes, far):
            forget_how_guided_flies(it, planes)
            expected = "QLAND" if it.state.vtol_state == GOES_OVER else "GUIDED"
            where = it.state.position
            await it.adapter.stop("emergency_stop")
            assert planes.mode(it) == expected
        await it.until(lambda: it.state.vtol_state == HOVERS, 20.0)
        await asyncio.sleep(3.0)
        assert planes.away(it, where) < 60.0
        await it.do("get_parameters", names=["Q_GUIDED_MODE"])
        await it.adapter.stop("hover")
        await comes_to_stand(it, planes, it.state.relative_altitude, it.state.position)
    position, _ = planes.place(it, 0.0, 0.0, HEIGHT)
    await exhausted(it.adapter.navigate(GoTo(Goal(position=position))))


async def goes_over_to_its_wings(it, planes):
    """Go over; what it takes changes with it, and it takes no velocities there."""
    await it.do("transition", to="forward")
    assert it.state.vtol_state == FLIES_FORWARD
    await it.until(lambda: "move_forward" in it.robot.lacking, 10.0)
    with pytest.raises(Unsupported):
        it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
    await it.do("transition", to="forward")


async def is_stopped_on_its_wings(it, planes):
    """Stop it: it circles where it was, at its height."""
    where, height = it.state.position, it.state.relative_altitude
    await it.adapter.stop("emergency_stop")
    assert planes.mode(it) == planes.flavour(it).hold
    began = planes.session(it).vehicle.now()
    while planes.session(it).vehicle.now() - began < 25.0:
        assert planes.speed(it) > 5.0
        assert planes.away(it, where) < 350.0
        assert abs(it.state.relative_altitude - height) < 15.0
        await asyncio.sleep(1.0)
    assert it.state.vtol_state == FLIES_FORWARD


async def flies_to_a_place_on_its_wings(it, planes):
    """Send it: PX4 circles there, a QuadPlane comes to hover there."""
    position, there = planes.place(it, 300.0, 100.0, 40.0)
    steps = await exhausted(it.adapter.navigate(GoTo(Goal(position=position))))
    assert steps[-1].percent == 100.0
    if is_arduplane(it):
        assert it.state.vtol_state == HOVERS
        assert planes.away(it, there) < 5.0
    else:
        assert it.state.vtol_state == FLIES_FORWARD
        await planes.circles(it, there)


async def keeps_its_limit_on_its_wings(it, planes):
    """Send it far off, at an airspeed under its cruise."""
    wanted = 20.0 if is_arduplane(it) else 13.0
    position, _ = planes.place(it, -700.0, 100.0, 40.0)
    task = GoTo(Goal(position=position), constraints=Constraints(max_speed=wanted))
    going = asyncio.ensure_future(exhausted(it.adapter.navigate(task)))
    seen = []
    while not going.done():
        seen.append(planes.speed(it))
        await asyncio.sleep(0.5)
    await going
    assert sorted(seen)[int(0.95 * len(seen))] < wanted + 3.0, f"{max(seen):.1f} m/s"


async def flies_a_mission_that_ends_in_a_circle(it, planes):
    """Fly to a place and stay at another; the mission is over when it is there, and it is held."""
    if not is_arduplane(it):
        return  # in its hover PX4 flies it as a multirotor, and wants a landing in it
    items = []
    for kind, east, north in (("waypoint", -300.0, 300.0), ("loiter_unlimited", 200.0, 300.0)):
        _, there = planes.place(it, east, north)
        items.append(PlanItem(kind, GeoPoint(there.latitude, there.longitude, 40.0)))
    await exhausted(it.adapter.navigate(FlyMission("out", tuple(items))))
    assert planes.mode(it) == planes.flavour(it).hold
    assert planes.away(it, items[-1].point) < 250.0
    assert it.state.armed


async def goes_back_to_its_hover(it, planes):
    await it.do("transition", to="forward")
    await it.do("transition", to="hover")
    assert it.state.vtol_state == HOVERS
    await it.until(lambda: planes.speed(it) < 1.0, 40.0)
    height = it.state.relative_altitude
    await asyncio.sleep(10.0)
    assert abs(it.state.relative_altitude - height) < SINKS
    assert planes.speed(it) < 1.5


async def is_stopped_on_the_way_to_its_hover(it, planes):
    """Stop it while it goes back from its wings, early and late: it hovers, near there, at its height."""
    for reason, later in (("stop", 0.0), ("emergency_stop", 2.0)):
        await it.do("transition", to="forward")
        await it.until(lambda: planes.speed(it) > 8.0, LONG)
        going = asyncio.ensure_future(it.do("transition", to="hover"))
        await it.until(lambda: it.state.vtol_state in {SLOWS, HOVERS}, 20.0)
        await asyncio.sleep(later)
        where, height = it.state.position, it.state.relative_altitude
        await it.adapter.stop(reason)
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)
        farthest = 0.0
        async with asyncio.timeout(40.0):
            while planes.speed(it) > 1.0 or it.state.vtol_state != HOVERS:
                farthest = max(farthest, planes.away(it, where))
                await asyncio.sleep(0.1)
        await comes_to_stand(it, planes, height, where, within=200.0)  # a QuadPlane comes from 25 m/s
        back = farthest - planes.away(it, where)
        assert back < 20.0, f"it flew {farthest:.0f} m on, and {back:.0f} m back"


async def flies_home_and_lands(it, planes):
    home = it.state.home
    await it.do("return_to_home")
    assert not it.state.armed
    assert planes.away(it, home) < 10.0


async def lands_by_a_plan(it, planes):
    """Fly a plan that ends with a landing: it comes down with its rotors, at the place.

    It comes from its wings on PX4, from the ground else, also after a landing of the same plan.
    """
    if not is_arduplane(it):
        await it.do("takeoff", altitude=HEIGHT)
        await it.do("transition", to="forward")
    items = []
    for kind, north, height in (("waypoint", 400.0, 40.0), ("waypoint", 300.0, 40.0), ("land", 0.0, 0.0)):
        _, there = planes.place(it, 0.0, north)
        items.append(PlanItem(kind, GeoPoint(there.latitude, there.longitude, height)))
    going = asyncio.ensure_future(exhausted(it.adapter.navigate(FlyMission("down", tuple(items)))))
    await it.until(lambda: it.state.vtol_state == FLIES_FORWARD or going.done(), LONG)
    await it.until(lambda: it.state.vtol_state == HOVERS or going.done(), LONG)
    await going
    assert not it.state.armed
    assert it.state.in_air is False
    assert planes.away(it, items[-1].point) < 10.0, f"{planes.away(it, items[-1].point):.0f} m off"


async def takes_off_after_its_landings(it, planes):
    """Take off again with its rotors, from the landing of a plan and from its own."""
    for _ in range(2):
        await planes.is_met_and_ready(it)
        await takes_off_with_its_rotors(it, planes)
        await it.do("land")


STEPS = (
    is_set_up,
    takes_off_with_its_rotors,
    is_stopped_in_its_hover,
    is_stopped_first_when_its_link_is_back,
    is_stopped_while_it_is_not_heard,
    goes_to_a_place_in_its_hover,
    is_stopped_on_the_way_to_its_wings,
    is_stopped_without_knowing_how_guided_flies,
    goes_over_to_its_wings,
    is_stopped_on_its_wings,
    flies_to_a_place_on_its_wings,
    keeps_its_limit_on_its_wings,
    flies_a_mission_that_ends_in_a_circle,
    goes_back_to_its_hover,
    is_stopped_on_the_way_to_its_hover,
    flies_home_and_lands,
    lands_by_a_plan,
    takes_off_after_its_landings,
    lands_by_a_plan,
)


async def fly(it, planes, note):
    """Fly the list; ``note(line)`` is told how long each step took, and what the autopilot said."""
    loop = asyncio.get_running_loop()
    for step in STEPS:
        began = loop.time()
        try:
            await step(it, planes)
        except (AssertionError, CommandError, TimeoutError, pytest.fail.Exception) as error:
            note(f"FAILED {step.__name__} after {loop.time() - began:.1f} s: {error}")
            for said in list(planes.session(it).vehicle.sentences)[-10:] if it.robot.is_connected else ():
                note(f"    it said: {said.text}")
            raise
        note(f"ok     {step.__name__} {loop.time() - began:.1f} s")
