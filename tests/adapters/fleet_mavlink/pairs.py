"""Pairs of requests that follow each other quickly, and what must be true of the vehicle afterwards.

``play`` brings a hosted vehicle into a state, sends one request, and another a moment later. It returns what
is wrong: an answer that is not true, motion that nobody wants any more, a descent by a take-off, motors that
stop in the air.
"""

import asyncio
from dataclasses import dataclass

from fleet import FlyMission, GeoOrigin, GeoPoint, Goal, GoTo, PlanItem, RelativeMove, Vector3
from fleet.model.geodesy import geo_from_world
from fleet.model.navigation import Control
from tests.adapters.fleet_mavlink import pair_verdicts as verdicts
from tests.adapters.fleet_mavlink.pair_verdicts import BRAKES, RISE, SINK, STEP, TAKEOFF, Flown, judge, look

NEAR = Vector3(6.0, 4.0, 9.0)  # m: east, north, up
FAR = Vector3(0.0, -60.0, 10.0)
LAST = (10.0, 5.0, 9.0)  # m: east, north, up of the last item of the mission
SPEED = 1.0  # m/s
LONG = 700.0  # s


def mission(it):
    """Return a mission of two places near the vehicle's home."""
    home = it.state.home
    origin = GeoOrigin(home.latitude, home.longitude)

    def waypoint(east, north, height):
        point = geo_from_world(origin, Vector3(east, north, 0.0))
        return PlanItem("waypoint", GeoPoint(point.latitude, point.longitude, height))

    return FlyMission("survey", (waypoint(0.0, 6.0, 8.0), waypoint(*LAST)))


@dataclass(frozen=True)
class Request:
    """One request: how it is sent, and how its success is judged."""

    name: str
    send: object
    judge: object
    seconds: float = 0.0  # for which it is sent again and again

    def __str__(self):
        return self.name


class _Stream:
    """The velocities of a stick as one request: refused if none was taken."""

    name = "velocity"

    def __init__(self):
        self.all = []
        self.over = False

    @property
    def end(self):
        if not self.over:
            return None
        taken = [each for each in self.all if each.end is not None and each.end.done]
        return (taken or self.all)[-1].end

    @property
    def reason(self):
        return self.end.reason if self.end else ""

    def __str__(self):
        return f"velocity: {self.end.outcome if self.end else 'under way'}"


def _stick(it):
    stream = _Stream()

    async def drive():
        for _ in range(10):
            stream.all.append(it.hold(x=SPEED))
            await asyncio.sleep(0.1)
        stream.over = True

    stream.task = asyncio.ensure_future(drive())
    return stream


def _command(name, judge, label="", **data):
    return Request(label or name, lambda it: it.request(name, **data), judge)


def _task(name, task, judge):
    return Request(name, lambda it: it.go(task), judge)


def _goto(name, place):
    goal = GoTo(Goal(Vector3(place.x, place.y, place.z)))
    return _task(name, goal, verdicts.arrived((place.x, place.y, place.z)))


REQUESTS = {
    each.name: each
    for each in (
        _command("takeoff", verdicts.climbed, altitude=TAKEOFF),
        _command("land", verdicts.landed),
        _command("return_to_home", verdicts.came_home),
        _goto("goto_near", NEAR),
        _goto("goto_far", FAR),
        Request("velocity", _stick, verdicts.moved, seconds=1.0),
        _task("relative", RelativeMove(Vector3(STEP, 0.0, 0.0)), verdicts.nothing),
        _command("ascend", verdicts.risen(RISE), distance=RISE),
        _command("descend", verdicts.risen(-SINK), distance=SINK),
        _command("arm", verdicts.is_armed),
        _command("disarm", verdicts.is_disarmed),
        _command("disarm", verdicts.is_disarmed, label="disarm_force", force=True),
        _command("cancel_takeoff", verdicts.halted),
        _command("stop", verdicts.halted),
        _command("hover", verdicts.halted),
        _command("emergency_stop", verdicts.halted),
        Request("mission", lambda it: it.go(mission(it)), verdicts.arrived(LAST)),
        _task("pause", Control.PAUSE, verdicts.halted),
        _task("resume", Control.RESUME, verdicts.nothing),
    )
}
FIRST = [name for name in REQUESTS if name not in {"resume", "disarm_force"}]
SECOND = list(REQUESTS)
DELAYS = (0.0, 0.1, 0.3, 0.6, 1.2, 2.5)
COMES_DOWN = {"LAND", "RTL"}
CLIMB = 20.0  # m


async def _ground(_it):
    """Leave it on the ground with its motors off."""


async def _armed(it):
    await it.does("arm")


async def _hovering(it):
    await it.does("takeoff", altitude=8.0)


async def _climbing(it):
    it.request("takeoff", altitude=CLIMB)
    await it.until(lambda: it.height > 3.0)


async def _landing(it):
    await _hovering(it)
    it.request("land")
    await it.until(lambda: it.height < 5.0)


async def _failsafe(it):
    """Let it return home by its own fail-safe."""
    await it.does("takeoff", altitude=8.0)
    await it.done(it.go(GoTo(Goal(Vector3(20.0, 0.0, 8.0)))))
    failsafes = it.sim.pilot.failsafes
    if it.sim.flavour == "ardupilot":
        failsafes._fail("battery", "Battery 1 is low 10.00V used 500 mAh", "RTL")
    else:
        failsafes._fail("battery", "LOITER", then="RTL", cause="critical")
    await it.until(lambda: it.losses and it.mode == "RTL")


async def _driving(it):
    """Let a rover be on its way."""
    await it.does("arm")
    it.go(GoTo(Goal(Vector3(90.0, 0.0, 0.0))))
    await it.until(lambda: it.speed > 1.0)


STATES = {
    "ground": _ground,
    "armed": _armed,
    "hovering": _hovering,
    "climbing": _climbing,
    "landing": _landing,
    "failsafe": _failsafe,
}
ROVER_STATES = {"ground": _ground, "armed": _armed, "driving": _driving}
NOT_FOR_ROVERS = {"takeoff", "land", "ascend", "descend", "cancel_takeoff"}


class Monitor:
    """Notes where the vehicle is, and motors that stop in the air."""

    def __init__(self, it):
        self.it = it
        self.track = []
        self.faults = []
        self.on_end = []

    async def run(self):
        armed = self.it.armed
        while True:
            seen = look(self.it)
            self.track.append(seen)
            if armed and not seen.armed and (seen.height > 0.15 or (seen.drives and seen.speed > 0.6)):
                self.faults.append(f"disarmed at {seen.height:.1f} m, {seen.speed:.1f} m/s")
            armed = seen.armed
            for flown in self.on_end:
                if flown.after is None and flown.requested.end is not None:
                    flown.after = seen
            await asyncio.sleep(0.02)


async def _rests(it, track):
    """Let time pass until it stands for some seconds, or its motors are off."""
    since = it.now
    began = it.now
    while it.now - began < LONG:
        seen = track[-1]
        coming = seen.mode in COMES_DOWN and seen.armed and not seen.drives
        if not verdicts.stands(seen) or coming:
            since = it.now
        if it.now - since > BRAKES + 2.0:
            return True
        await asyncio.sleep(0.1)
    return False


async def play(it, state, first, second, delay):
    """Play one pair on a vehicle that was met; return what is wrong, and what was answered."""
    first, second = REQUESTS[first], REQUESTS[second]
    await (STATES | ROVER_STATES)[state](it)
    monitor = Monitor(it)
    watching = asyncio.ensure_future(monitor.run())
    try:
        before = look(it)
        lost = len(it.losses)
        one = Flown(first, first.send(it), before)
        monitor.on_end.append(one)
        await asyncio.sleep(first.seconds + delay)
        other = Flown(second, second.send(it), look(it), track=monitor.track)
        monitor.on_end.append(other)
        await asyncio.sleep(0.1)
        began = it.now
        while (other.requested.end is None or one.requested.end is None) and it.now - began < LONG:
            if second.name == "pause" and other.requested.end is not None:
                break
            await asyncio.sleep(0.1)
        rests = await _rests(it, monitor.track)
        return [
            *monitor.faults,
            *judge(it, one, other, rests=rests),
            *(f"lost: {why}" for why in it.losses[lost:]),
        ], (str(one.requested), str(other.requested))
    finally:
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
