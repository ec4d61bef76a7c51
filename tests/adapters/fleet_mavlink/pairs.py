"""Pairs of requests that follow each other quickly, and what must be true of the vehicle afterwards.

``play`` brings a hosted vehicle into a state, sends one request, and another a moment later. It returns what
is wrong: an answer that is not true, motion that nobody wants any more, a descent by a take-off, motors that
stop in the air.
"""

import asyncio
import math
from dataclasses import dataclass, field

from fleet import FlyMission, GeoOrigin, GeoPoint, Goal, GoTo, PlanItem, RelativeMove, Vector3
from fleet.model.geodesy import geo_from_world
from fleet.model.navigation import Control

NEAR = Vector3(6.0, 4.0, 9.0)  # m: east, north, up
FAR = Vector3(0.0, -60.0, 10.0)
LAST = (10.0, 5.0, 9.0)  # m: east, north, up of the last item of the mission
TAKEOFF, RISE, SINK, STEP = 7.0, 3.0, 2.0, 5.0  # m
SPEED = 1.0  # m/s
STILL = 0.4  # m/s, as fast as a vehicle that stands
EXACT = 0.8  # m
BRAKES = 8.0  # s
LONG = 700.0  # s


def mission(it):
    """Return a mission of two places near the vehicle's home."""
    home = it.state.home
    origin = GeoOrigin(home.latitude, home.longitude)

    def waypoint(east, north, height):
        point = geo_from_world(origin, Vector3(east, north, 0.0))
        return PlanItem("waypoint", GeoPoint(point.latitude, point.longitude, height))

    return FlyMission("survey", (waypoint(0.0, 6.0, 8.0), waypoint(*LAST)))


@dataclass
class Seen:
    """The vehicle at one moment, as it truly is."""

    at: float
    north: float
    east: float
    height: float
    speed: float
    armed: bool
    mode: str
    drives: bool = False  # on the ground, and not in the air

    def away(self, place):
        """Return the metres to a place: east, north, up."""
        return math.dist((self.east, self.north, self.height), place)

    @property
    def grounded(self):
        return self.height < 0.1 and not self.drives


def look(it):
    north, east, height = it.place
    return Seen(it.now, north, east, height, it.speed, it.armed, it.mode, it.drives)


@dataclass
class Flown:
    """What happened to one request: the vehicle at its beginning, at its end, and at the end of all."""

    what: "Request"
    asked: object
    before: Seen
    after: Seen | None = None
    track: list = field(default_factory=list)

    @property
    def done(self):
        return self.asked.end is not None and bool(self.asked.end.done)

    @property
    def refused(self):
        return self.asked.end is not None and not self.asked.end.done


def _stands(seen):
    return seen.speed < STILL or (seen.grounded and not seen.armed)


def _climbed(flown, last):
    """A take-off ends at its height, or where it was if that was higher."""
    wanted = max(TAKEOFF, flown.before.height)
    if not last.armed:
        return "took off, and is disarmed"
    if last.height < wanted - EXACT:
        return f"took off to {last.height:.1f} m of {wanted:.1f}"
    if flown.before.height < TAKEOFF - 1.5 and last.height > TAKEOFF + 1.5:
        return f"took off past its height, to {last.height:.1f} m"
    drifted = math.hypot(last.north - flown.after.north, last.east - flown.after.east)
    if drifted > 2.0 + 2.0 * flown.after.speed:
        return f"took off, and flew on for {drifted:.1f} m"
    return "" if _stands(last) else f"took off, and moves at {last.speed:.1f} m/s"


def _landed(flown, last):
    if flown.after.armed or not flown.after.grounded:
        return f"landed, and is {'armed ' * flown.after.armed}at {flown.after.height:.1f} m"
    return "" if not last.armed else "landed, and is armed later"


def _came_home(flown, last):
    """A rover stands at home."""
    if not flown.before.drives:
        return _landed(flown, last)
    away = math.hypot(flown.after.north, flown.after.east)
    return f"came home {away:.1f} m beside" if flown.before.armed and away > 2.0 else ""


def _arrived(place):
    def judge(flown, last):
        there = place if not last.drives else (*place[:2], 0.0)
        off = 1.5 + 1.0 * last.drives
        if flown.after.away(there) > off:
            return f"arrived {flown.after.away(there):.1f} m beside"
        return "" if _stands(last) and last.away(there) < off + 1.0 else f"arrived, and left: {last}"

    return judge


def _moved(_flown, last):
    """A velocity that is held no more has ended."""
    return "" if _stands(last) else f"driven, and still moves at {last.speed:.1f} m/s"


def _risen(metres):
    def judge(flown, last):
        off = last.height - flown.before.height - metres
        slack = EXACT + 1.2 * abs(flown.before.speed)
        return f"its height is {off:+.1f} m off" if abs(off) > slack else ""

    return judge


def _is_armed(flown, _last):
    return "" if flown.after.armed else "armed, and is not"


def _is_disarmed(flown, last):
    return "disarmed, and is armed" if flown.after.armed or last.armed else ""


def _halted(flown, last):
    """Once a stop has ended it stands, after a way to brake, and stays."""
    late = [seen for seen in flown.track if seen.at > flown.after.at + BRAKES and not seen.grounded]
    fast = [seen for seen in late if seen.speed > STILL]
    if fast:
        return f"stopped, and moves at {fast[0].speed:.1f} m/s in {fast[0].mode}"
    off = math.dist((last.north, last.east, last.height), (flown.after.north, flown.after.east, flown.after.height))
    return f"stopped, and is {off:.1f} m away" if off > 1.5 + 2.5 * flown.after.speed else ""


def _nothing(_flown, _last):
    return ""


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
    return Request(label or name, lambda it: it.ask(name, **data), judge)


def _task(name, task, judge):
    return Request(name, lambda it: it.go(task), judge)


def _goto(name, place):
    goal = GoTo(Goal(Vector3(place.x, place.y, place.z)))
    return _task(name, goal, _arrived((place.x, place.y, place.z)))


REQUESTS = {
    each.name: each
    for each in (
        _command("takeoff", _climbed, altitude=TAKEOFF),
        _command("land", _landed),
        _command("return_to_home", _came_home),
        _goto("goto_near", NEAR),
        _goto("goto_far", FAR),
        Request("velocity", _stick, _moved, seconds=1.0),
        _task("relative", RelativeMove(Vector3(STEP, 0.0, 0.0)), _nothing),
        _command("ascend", _risen(RISE), distance=RISE),
        _command("descend", _risen(-SINK), distance=SINK),
        _command("arm", _is_armed),
        _command("disarm", _is_disarmed),
        _command("disarm", _is_disarmed, label="disarm_force", force=True),
        _command("cancel_takeoff", _halted),
        _command("stop", _halted),
        _command("hover", _halted),
        _command("emergency_stop", _halted),
        Request("mission", lambda it: it.go(mission(it)), _arrived(LAST)),
        _task("pause", Control.PAUSE, _halted),
        _task("resume", Control.RESUME, _nothing),
    )
}
FIRST = [name for name in REQUESTS if name not in {"resume", "disarm_force"}]
SECOND = list(REQUESTS)
DELAYS = (0.0, 0.1, 0.3, 0.6, 1.2, 2.5)
COMES_DOWN = {"LAND", "RTL"}
CLIMB = 20.0  # m


async def _ground(_it):
    """On the ground with its motors off."""


async def _armed(it):
    await it.does("arm")


async def _hovering(it):
    await it.does("takeoff", altitude=8.0)


async def _climbing(it):
    it.ask("takeoff", altitude=CLIMB)
    await it.until(lambda: it.height > 3.0)


async def _landing(it):
    await _hovering(it)
    it.ask("land")
    await it.until(lambda: it.height < 5.0)


async def _failsafe(it):
    """Returning home by its own fail-safe."""
    await it.does("takeoff", altitude=8.0)
    await it.done(it.go(GoTo(Goal(Vector3(20.0, 0.0, 8.0)))))
    failsafes = it.sim.pilot.failsafes
    if it.sim.flavour == "ardupilot":
        failsafes._fail("battery", "Battery 1 is low 10.00V used 500 mAh", "RTL")
    else:
        failsafes._fail("battery", "LOITER", then="RTL", cause="critical")
    await it.until(lambda: it.losses and it.mode == "RTL")


async def _driving(it):
    """A rover on its way."""
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
                if flown.after is None and flown.asked.end is not None:
                    flown.after = seen
            await asyncio.sleep(0.02)


async def _rests(it, track):
    """Let time pass until it stands for some seconds, or its motors are off."""
    since = it.now
    began = it.now
    while it.now - began < LONG:
        seen = track[-1]
        coming = seen.mode in COMES_DOWN and seen.armed and not seen.drives
        if not _stands(seen) or coming:
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
        while (other.asked.end is None or one.asked.end is None) and it.now - began < LONG:
            if second.name == "pause" and other.asked.end is not None:
                break
            await asyncio.sleep(0.1)
        rests = await _rests(it, monitor.track)
        return [
            *monitor.faults,
            *judge(it, one, other, rests=rests),
            *(f"lost: {why}" for why in it.losses[lost:]),
        ], (str(one.asked), str(other.asked))
    finally:
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)


def judge(it, one, other, *, rests):
    """Yield what is wrong at the end."""
    last = look(it)
    if not rests:
        yield f"never rests: {last}"
    if other.asked.end is None:
        yield f"no end of {other.asked}"
        return
    if other.done:
        trouble = other.what.judge(other, last)
        if trouble:
            yield f"{other.what} done, but: {trouble}"
    elif other.refused:
        if not other.asked.reason or _untrue(other, one, it):
            yield f"{other.what} refused, because: {other.asked.reason}"
        if other.after is not None and not other.what.judge(other, last) and _means_something(other):
            yield f"{other.what} failed, but it happened: {other.asked.reason}"
    if one.done and one.after is not None and one.what.name in {"land", "return_to_home", "disarm"}:
        trouble = one.what.judge(one, one.after)
        if trouble:
            yield f"first {one.what} done, but: {trouble}"
    if last.armed and last.grounded and last.speed > STILL:
        yield f"moves on the ground: {last}"


def _untrue(other, one, it):
    """Return a reason of a refusal that is not true; empty for one that is, or was until just now."""
    reason, before = other.asked.reason, other.before
    known = (
        reason.startswith(("busy with ", "there is no ", "emergency stop is set", "it is not armed"))
        or (reason.startswith("not in the air") and before.height < 0.3)
        or (reason.startswith("it is in the air and would fall") and before.height > 0.05)
        or ("a pilot or a fail-safe has it" in reason and it.losses)
        or (" is below 1 m" in reason and before.height < SINK + 1.5)
        or (reason.startswith("it moves, and would coast") and before.speed > 0.3)
        or (it.sim.faults and _lost(reason))
        or (reason.startswith("busy: it takes off") and "takeoff" in {one.what.name, before.mode.lower()})
    )
    return "" if known else reason


def _lost(reason):
    """Return True for a reason that a bad link has."""
    return any(words in reason for words in ("did not answer", "does not change to", "did not say", "no heartbeat", "is unknown"))


def _means_something(flown):
    """Return True for requests whose success can be seen afterwards."""
    return flown.what.name in {"goto_near", "goto_far", "mission"} or (
        flown.what.name in {"land", "return_to_home", "disarm"} and flown.before.armed
    )
