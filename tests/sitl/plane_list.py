"""What every plane is flown through: simulated ones in each run of the tests, real ones by address.

A step is a coroutine that takes ``it``: the adapter on a link. It fails by raising.
"""

from __future__ import annotations

import asyncio
import contextlib

import pytest

from fleet import (
    FlyMission,
    GeoOrigin,
    GeoPoint,
    Goal,
    GoTo,
    PlanItem,
    Refused,
    Unsupported,
    Vector3,
    Velocity,
)
from fleet.errors import CommandError
from fleet.model.geodesy import geo_from_world, world_from_geo
from fleet.model.navigation import Constraints
from fleet.model.report import FlightControllerReport, GpsReport, PoseReport
from fleet_mavlink.constants import ARDUPILOT, PX4

LONG = 300.0  # s
HEIGHT = 40.0  # m
NEAR_HEIGHT = 10.0  # m


def session(it):
    return it.adapter._session


def mode(it):
    return session(it).vehicle.kind.mode_of(it.state)


def flavour(it):
    return session(it).vehicle.flavour


def speed(it):
    return it.state.velocity.horizontal() if it.state.velocity else 0.0


def away(it, place):
    """Return metres over ground to a place."""
    here = it.state.position
    return world_from_geo(GeoOrigin(here.latitude, here.longitude), place).horizontal()


def place(it, east, north, height=HEIGHT):
    """Return a place, m from the origin and above home."""
    return Vector3(east, north, height), geo_from_world(session(it).origin(), Vector3(east, north, height))


async def exhausted(steps):
    return [step async for step in steps]


@contextlib.contextmanager
def silence(it, *, both_directions=True):
    """Hear nothing of the vehicle; it hears nothing either, if the link is lost ``both_directions``."""
    hub = session(it)._hub
    lost = ("receive", "send", "send_from_any_thread") if both_directions else ("receive",)
    for method in lost:
        setattr(hub, method, lambda *_: None)
    try:
        yield
    finally:
        for method in lost:
            delattr(hub, method)


async def circles(it, centre, seconds=30.0):
    """See it go round a place for a while; it never stands."""
    reach = flavour(it).reach(it.state)
    began = session(it).vehicle.now()
    while session(it).vehicle.now() - began < seconds:
        assert speed(it) > 5.0
        assert away(it, centre) < reach + 25.0, f"{away(it, centre):.0f} m off"
        await asyncio.sleep(1.0)


async def is_met_and_ready(it):
    """Hear it, and let it tell what it is, where, and how it flies."""
    await it.until(lambda: it.robot.is_connected and it.state.home_altitude is not None, LONG)
    for kind in (PoseReport, GpsReport, FlightControllerReport):
        await it.until(lambda kind=kind: any(isinstance(each, kind) for each in it.robot.reports), LONG)
    speeds = [name for name in flavour(it).settings if "AIRSP" in name]
    await it.until(lambda: set(speeds) <= set(it.state.settings), LONG)
    for _ in range(60):
        if (await it.do("check_ready"))["ready"]:
            return
        await asyncio.sleep(1.0)
    raise AssertionError(await it.do("check_ready"))


async def refuses_what_wings_cannot(it):
    """Ask for a velocity, a turn, a slow goal: each is refused with what is possible."""
    assert {"move_forward", "strafe_left", "turn_left", "transition"} <= set(it.robot.lacking)
    with pytest.raises(Unsupported, match="never stands"):
        it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
    with pytest.raises(Unsupported, match="no VTOL"):
        await it.do("transition", to="hover")
    with pytest.raises(Refused, match="is not 15 to"):
        await it.do("takeoff", altitude=5.0)


async def is_informed_that_missions_need_no_landing(it):
    """PX4 wants a landing in the mission of a plane, unless it is told not to, on the ground."""
    if it.state.heartbeat.autopilot == PX4:
        await it.do("set_parameter", name="MIS_TKO_LAND_REQ", value=0)


async def takes_off(it):
    await it.do("takeoff", altitude=HEIGHT)
    assert abs(it.state.relative_altitude - HEIGHT) < NEAR_HEIGHT
    assert mode(it) in {flavour(it).goto, flavour(it).hold}


async def circles_a_goal(it):
    """Send it to a place at an airspeed; it has arrived in its circle, and goes on round it."""
    for east, north, height in ((250.0, 150.0, 50.0), (-150.0, 250.0, HEIGHT)):
        position, there = place(it, east, north, height)
        task = GoTo(Goal(position=position), constraints=Constraints(max_speed=15.0))
        steps = await exhausted(it.adapter.navigate(task))
        assert steps[-1].percent == 100.0
        await circles(it, there)
        assert abs(it.state.relative_altitude - height) < NEAR_HEIGHT


async def refuses_a_goal_that_it_cannot_fly_to(it):
    position, _ = place(it, 0.0, 100.0)
    slow = GoTo(Goal(position=position), constraints=Constraints(max_speed=2.0))
    with pytest.raises(Refused, match="cannot fly slower than"):
        await exhausted(it.adapter.navigate(slow))
    with pytest.raises(Refused, match="cannot turn to a yaw"):
        await exhausted(it.adapter.navigate(GoTo(Goal(position=position, yaw=1.0))))
    with pytest.raises(Refused, match="below 15 m"):
        await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(0.0, 100.0, 5.0)))))


async def climbs_and_sinks_in_its_circle(it):
    before = it.state.relative_altitude
    await it.do("ascend", distance=15.0)
    assert abs(it.state.relative_altitude - before - 15.0) < NEAR_HEIGHT
    await it.do("descend", distance=15.0)
    assert abs(it.state.relative_altitude - before) < 2 * NEAR_HEIGHT


async def is_stopped_by_every_word(it):
    """Send it far away, and stop it: it circles where it was, at its height."""
    for reason, east in (("stop", 3000.0), ("emergency_stop", -3000.0), ("pause", 3000.0)):
        position, _ = place(it, east, 0.0)
        going = asyncio.ensure_future(exhausted(it.adapter.navigate(GoTo(Goal(position=position)))))
        await it.until(lambda: mode(it) == flavour(it).goto, LONG)
        await asyncio.sleep(8.0)
        where, height = it.state.position, it.state.relative_altitude
        await it.adapter.stop(reason)
        assert mode(it) == flavour(it).hold
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)
        began = session(it).vehicle.now()
        while session(it).vehicle.now() - began < 25.0:
            assert away(it, where) < 2 * flavour(it).reach(it.state) + 40.0
            assert abs(it.state.relative_altitude - height) < 15.0
            await asyncio.sleep(1.0)
        assert speed(it) > 5.0
        with pytest.raises(CommandError):
            await it.do("disarm")


async def is_stopped_first_when_its_link_is_back(it):
    """Lose it on its way, and stop it by the first that it hears again: it circles there, at its height."""
    position, _ = place(it, 3000.0, 0.0)
    going = asyncio.ensure_future(exhausted(it.adapter.navigate(GoTo(Goal(position=position)))))
    await it.until(lambda: mode(it) == flavour(it).goto, LONG)
    await asyncio.sleep(8.0)
    with silence(it):
        await asyncio.sleep(5.0)
    await it.until(lambda: session(it).vehicle.connected, 10.0)
    where, height = it.state.position, it.state.relative_altitude
    await it.adapter.stop("it was lost while it moved")
    going.cancel()
    await asyncio.gather(going, return_exceptions=True)
    began = session(it).vehicle.now()
    while session(it).vehicle.now() - began < 25.0:
        assert away(it, where) < 2 * flavour(it).reach(it.state) + 40.0
        assert abs(it.state.relative_altitude - height) < 15.0
        await asyncio.sleep(1.0)


async def flies_a_mission(it):
    """Fly two places and a circle; at its end it circles, held."""
    items = []
    for east, north, kind in (
        (200.0, 0.0, "waypoint"),
        (200.0, 300.0, "waypoint"),
        (0.0, 300.0, "loiter_time"),
    ):
        _, there = place(it, east, north)
        point = GeoPoint(there.latitude, there.longitude, HEIGHT)
        items.append(PlanItem(kind, point, seconds=5.0 if kind == "loiter_time" else 0.0))
    plan = FlyMission("round", tuple(items))
    await exhausted(it.adapter.navigate(plan))
    assert mode(it) == flavour(it).hold
    assert it.state.armed


async def flies_home(it):
    """Fly home by the autopilot's own mode, and circle there."""
    await it.do("return_to_home")
    assert mode(it) == flavour(it).return_home
    assert away(it, it.state.home) < flavour(it).reach(it.state) + 20.0


async def lands_where_it_can(it):
    """Land: PX4 anywhere, ArduPlane not without a landing in its mission."""
    if it.state.heartbeat.autopilot == ARDUPILOT:
        with pytest.raises(CommandError, match="landing sequence"):
            await it.do("land")
        await it.adapter.stop("hover")
        return
    await it.do("land")
    assert not it.state.armed


async def flies_a_plan_to_its_landing(it):
    """Fly a plan that ends with a landing: it is seen on the ground, near the place, its motor off."""
    if it.state.heartbeat.autopilot == ARDUPILOT:
        await it.do("set_parameter", name="RTL_AUTOLAND", value=3, force=True)
    items = [PlanItem("land_start")]
    for kind, north, height in (
        ("waypoint", 700.0, 50.0),
        ("loiter_to_altitude", 600.0, 40.0),
        ("land", 0.0, 0.0),
    ):
        _, there = place(it, 0.0, north)
        radius = 80.0 if kind == "loiter_to_altitude" else None
        items.append(PlanItem(kind, GeoPoint(there.latitude, there.longitude, height), radius=radius))
    items[0], items[1] = items[1], items[0]
    await exhausted(it.adapter.navigate(FlyMission("down", tuple(items))))
    assert not it.state.armed
    assert it.state.in_air is False
    assert away(it, items[-1].point) < 200.0, f"{away(it, items[-1].point):.0f} m off"


async def takes_off_after_its_landing(it):
    """Take off again, and circle: ArduPlane does not arm before its mission is rewound."""
    await is_met_and_ready(it)
    await takes_off(it)


STEPS = (
    is_met_and_ready,
    refuses_what_wings_cannot,
    is_informed_that_missions_need_no_landing,
    takes_off,
    circles_a_goal,
    refuses_a_goal_that_it_cannot_fly_to,
    climbs_and_sinks_in_its_circle,
    is_stopped_by_every_word,
    is_stopped_first_when_its_link_is_back,
    flies_a_mission,
    flies_home,
    lands_where_it_can,
    flies_a_plan_to_its_landing,
    takes_off_after_its_landing,
)


async def fly(it, note, steps=STEPS):
    """Fly the list; ``note(line)`` is told how long each step took, and what the autopilot said."""
    loop = asyncio.get_running_loop()
    for step in steps:
        began = loop.time()
        try:
            await step(it)
        except (AssertionError, CommandError, TimeoutError, pytest.fail.Exception) as error:
            note(f"FAILED {step.__name__} after {loop.time() - began:.1f} s: {error}")
            for said in list(session(it).vehicle.sentences)[-10:] if it.robot.is_connected else ():
                note(f"    it said: {said.text}")
            raise
        note(f"ok     {step.__name__} {loop.time() - began:.1f} s")
