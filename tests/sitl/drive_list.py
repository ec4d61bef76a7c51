"""What every rover and boat is driven through: simulated ones in each run of the tests, real ones by address.

A step is a coroutine that takes ``it`` (the adapter on a link) and ``other`` (another ground station).
"""

from __future__ import annotations

import asyncio
import math

import pytest

from fleet import (
    FlyMission,
    GeoOrigin,
    GeoPoint,
    Goal,
    GoTo,
    PlanItem,
    RelativeMove,
    Unsupported,
    Vector3,
    Velocity,
)
from fleet.errors import CommandError
from fleet.model.geodesy import geo_from_world, world_from_geo
from fleet.model.report import FlightControllerReport, GpsReport, PoseReport

LONG = 240.0  # s
GUIDED = 15
NEAR = 1.5  # m
AHEAD = Velocity(Vector3(2.0, 0.0, 0.0))
BACK = Velocity(Vector3(-1.0, 0.0, 0.0))


def vehicle(it):
    return it.adapter._session.vehicle


def mode(it):
    return vehicle(it).kind.mode_of(it.state)


def holds(it):
    return vehicle(it).flavour.hold


def speed(it):
    return it.state.velocity.horizontal() if it.state.velocity else 0.0


def away(it, place):
    """Return metres over ground to a place."""
    here = it.state.position
    return world_from_geo(GeoOrigin(here.latitude, here.longitude), place).horizontal()


def nose(it):
    return it.state.attitude.yaw


def turned(it, before):
    return abs(math.remainder(nose(it) - before, math.tau))


def gone(it, start, heading):
    """Return metres from a start along a heading."""
    anchor = GeoOrigin(start.latitude, start.longitude)
    step = world_from_geo(anchor, GeoPoint(it.state.position.latitude, it.state.position.longitude))
    return step.y * math.cos(heading) + step.x * math.sin(heading)


async def exhausted(steps):
    return [step async for step in steps]


async def stands(it, within=15.0):
    await it.until(lambda: speed(it) < 0.25, within)


async def is_met(it, _other):
    """Hear it, and let it tell what it is and where."""
    await it.until(lambda: it.robot.is_connected and it.state.estimator_has_position, LONG)
    await it.until(lambda: it.state.home is not None and it.state.prearm_ok, LONG)
    for kind in (PoseReport, GpsReport, FlightControllerReport):
        await it.until(lambda kind=kind: any(isinstance(each, kind) for each in it.robot.reports), LONG)
    for _ in range(60):
        if (await it.do("check_ready"))["ready"]:
            return
        await asyncio.sleep(1.0)
    raise AssertionError(await it.do("check_ready"))


async def has_what_it_has(it, _other):
    """Ask for what it lacks; nothing is sent."""
    for name, data in (("takeoff", {}), ("land", {}), ("ascend", {"distance": 1.0})):
        assert name in it.robot.lacking
        with pytest.raises(Unsupported, match="moves on the surface"):
            await it.do(name, **data)


async def is_armed(it, _other):
    await it.do("arm")
    with pytest.raises(Unsupported, match="not sideways"):
        it.adapter.drive(Velocity(Vector3(0.0, 1.0, 0.0)))


async def is_driven_ahead_and_stopped(it, _other):
    """Drive it, keep its heading, let go of it: it stands and is held."""
    start, before = it.state.position, nose(it)
    await it.drive(AHEAD, 4.0)
    assert 1.4 < speed(it) < 2.8
    assert turned(it, before) < 0.15
    await it.adapter.stop("stop")
    await stands(it)
    await it.until(lambda: mode(it) == holds(it), 5.0)
    assert gone(it, start, before) > 4.0


async def is_driven_backwards(it, _other):
    """Drive it in reverse; its nose stays."""
    start, before = it.state.position, nose(it)
    await it.drive(BACK, 5.0)
    assert 0.5 < speed(it) < 1.6
    await it.adapter.stop("hover")
    await stands(it)
    assert gone(it, start, before) < -2.0
    assert turned(it, before) < 0.3


async def turns_to_the_left(it, _other):
    """Drive it with a rate of turn; a positive one is to the left."""
    before = nose(it)
    await it.drive(Velocity(Vector3(1.5, 0.0, 0.0), 0.4), 4.0)
    assert math.remainder(nose(it) - before, math.tau) < -0.6
    await it.adapter.stop("hover")
    await stands(it)


async def turns_where_it_stands_or_says_why_not(it, _other):
    """Ask for a turn and no speed: what is steered by its drives turns, what has steered wheels refuses."""
    await it.until(lambda: vehicle(it).turns_in_place is not None, LONG)
    turn = Velocity(Vector3(), 0.5)
    if not vehicle(it).turns_in_place:
        with pytest.raises(Unsupported, match="turns only while it drives"):
            it.adapter.drive(turn)
        return
    start, before = it.state.position, nose(it)
    await it.drive(turn, 4.0)
    assert math.remainder(nose(it) - before, math.tau) < -0.8
    assert away(it, start) < 1.0
    await it.adapter.stop("hover")
    await stands(it)


async def brakes_by_itself_when_nobody_drives_it(it, _other):
    """Fall silent after a velocity, as a process that is stuck does."""
    await it.drive(AHEAD, 3.0)
    it.adapter._session.driver.end()
    began = vehicle(it).now()
    await it.until(lambda: speed(it) < 0.25, 12.0)
    assert vehicle(it).now() - began > 1.5
    await it.adapter.stop("hover")


async def goes_to_places(it, _other):
    """Send it to a place at a speed, and along a path's second one."""
    home = it.state.home
    origin = it.adapter._session.origin()
    for east, north in ((10.0, 12.0), (0.0, 20.0)):
        steps = await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(east, north, 0.0)))))
        assert steps[-1].percent == 100.0
        assert away(it, geo_from_world(origin, Vector3(east, north, 0.0))) < NEAR
    assert home is not None


async def goes_back_by_a_distance(it, _other):
    """Move back in reverse, and then ahead: the nose points the same way."""
    for metres in (-6.0, 6.0):
        start, before = it.state.position, nose(it)
        await exhausted(it.adapter.navigate(RelativeMove(Vector3(metres, 0.0, 0.0))))
        assert gone(it, start, before) == pytest.approx(metres, abs=NEAR)
        assert turned(it, before) < 0.5


async def is_stopped_by_every_word_while_it_goes(it, _other):
    """Send it far, and stop it by each word; then a disarming is refused while it moves."""
    origin = it.adapter._session.origin()
    for reason, east in (("stop", 60.0), ("emergency_stop", -60.0), ("pause", 60.0)):
        far = GoTo(Goal(position=Vector3(east, 20.0, 0.0)))
        going = asyncio.ensure_future(exhausted(it.adapter.navigate(far)))
        await it.until(lambda: speed(it) > 2.0, LONG)
        with pytest.raises(CommandError, match="would coast"):
            await it.do("disarm")
        before = speed(it)
        await it.adapter.stop(reason)
        assert mode(it) == holds(it)
        assert speed(it) < before * 0.75
        going.cancel()
        await asyncio.gather(going, return_exceptions=True)
        await stands(it)
    assert origin is not None


async def another_station_drives_it_and_it_is_stopped(it, other):
    """Have it driven at 4 m/s by another station, and stop it by each word."""
    authority = it.adapter._session.authority
    for reason in ("stop", "emergency_stop", "hover"):
        other.request(176, 1, GUIDED)
        await it.until(lambda: authority.lost_to == "GUIDED", LONG)  # the second heartbeat that shows it
        authority.lost_to = ""
        async with other.driving(4.0):
            await it.until(lambda: speed(it) > 3.0, LONG)
            before = speed(it)
            await it.adapter.stop(reason)
            assert mode(it) == holds(it)
            assert speed(it) < before * 0.75
            await stands(it)


async def drives_a_mission_that_ends_at_home(it, _other):
    """Give it a plan: two places, then home; it stands there, held and armed."""
    origin = it.adapter._session.origin()

    def at(east, north):
        place = geo_from_world(origin, Vector3(east, north, 0.0))
        return GeoPoint(place.latitude, place.longitude, 0.0)

    plan = FlyMission(
        "round",
        (
            PlanItem("waypoint", at(8.0, 10.0), speed=2.0),
            PlanItem("loiter_time", at(16.0, 10.0), seconds=2.0),
            PlanItem("return_to_launch"),
        ),
    )
    await exhausted(it.adapter.navigate(plan))
    assert it.state.armed
    assert mode(it) == holds(it)
    assert away(it, it.state.home) < 2 * NEAR


async def drives_home(it, _other):
    """Go away, and home by the autopilot's own mode."""
    await exhausted(it.adapter.navigate(GoTo(Goal(position=Vector3(-12.0, 6.0, 0.0)))))
    await it.do("return_to_home")
    assert away(it, it.state.home) < 2 * NEAR
    assert mode(it) == "RTL"


async def is_disarmed(it, _other):
    await it.adapter.stop("hover")
    await stands(it)
    await asyncio.sleep(1.0)
    await it.do("disarm")
    assert not it.state.armed


STEPS = (
    is_met,
    has_what_it_has,
    is_armed,
    is_driven_ahead_and_stopped,
    is_driven_backwards,
    turns_to_the_left,
    turns_where_it_stands_or_says_why_not,
    brakes_by_itself_when_nobody_drives_it,
    goes_to_places,
    goes_back_by_a_distance,
    is_stopped_by_every_word_while_it_goes,
    another_station_drives_it_and_it_is_stopped,
    drives_a_mission_that_ends_at_home,
    drives_home,
    is_disarmed,
)


async def drive(it, other, note):
    """Drive the list; ``note(line)`` is told how long each step took, and what the autopilot said."""
    loop = asyncio.get_running_loop()
    for step in STEPS:
        began = loop.time()
        try:
            await step(it, other)
        except (AssertionError, CommandError, TimeoutError, pytest.fail.Exception) as error:
            note(f"FAILED {step.__name__} after {loop.time() - began:.1f} s: {error}")
            for said in list(vehicle(it).sentences)[-10:] if it.robot.is_connected else ():
                note(f"    it said: {said.text}")
            raise
        note(f"ok     {step.__name__} {loop.time() - began:.1f} s")
