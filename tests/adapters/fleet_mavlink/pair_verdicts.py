"""What must be true of a vehicle after a pair of requests, and of the answers to them."""

import math
from dataclasses import dataclass, field

TAKEOFF, RISE, SINK, STEP = 7.0, 3.0, 2.0, 5.0  # m
STILL = 0.4  # m/s, as fast as a vehicle that stands
EXACT = 0.8  # m
BRAKES = 8.0  # s
LOST = ("did not answer", "does not change to", "did not say", "no heartbeat", "is unknown")


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

    what: object
    requested: object
    before: Seen
    after: Seen | None = None
    track: list = field(default_factory=list)

    @property
    def done(self):
        return self.requested.end is not None and bool(self.requested.end.done)

    @property
    def refused(self):
        return self.requested.end is not None and not self.requested.end.done


def stands(seen):
    return seen.speed < STILL or (seen.grounded and not seen.armed)


def climbed(flown, last):
    """Expect it at its height, or where it was if that was higher."""
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
    return "" if stands(last) else f"took off, and moves at {last.speed:.1f} m/s"


def landed(flown, last):
    if flown.after.armed or not flown.after.grounded:
        return f"landed, and is {'armed ' * flown.after.armed}at {flown.after.height:.1f} m"
    return "" if not last.armed else "landed, and is armed later"


def came_home(flown, last):
    """Expect a rover that stands at home, anything else on the ground."""
    if not flown.before.drives:
        return landed(flown, last)
    away = math.hypot(flown.after.north, flown.after.east)
    return f"came home {away:.1f} m beside" if flown.before.armed and away > 2.0 else ""


def arrived(place):
    def judge(flown, last):
        there = place if not last.drives else (*place[:2], 0.0)
        off = 1.5 + 1.0 * last.drives
        if flown.after.away(there) > off:
            return f"arrived {flown.after.away(there):.1f} m beside"
        return "" if stands(last) and last.away(there) < off + 1.0 else f"arrived, and left: {last}"

    return judge


def moved(_flown, last):
    """Expect it to stand, once the velocity is held no more."""
    return "" if stands(last) else f"driven, and still moves at {last.speed:.1f} m/s"


def risen(metres):
    def judge(flown, last):
        off = last.height - flown.before.height - metres
        slack = EXACT + 1.2 * abs(flown.before.speed)
        return f"its height is {off:+.1f} m off" if abs(off) > slack else ""

    return judge


def is_armed(flown, _last):
    return "" if flown.after.armed else "armed, and is not"


def is_disarmed(flown, last):
    return "disarmed, and is armed" if flown.after.armed or last.armed else ""


def halted(flown, last):
    """Expect it to stand once a stop has ended, after a way to brake, and to stay."""
    late = [seen for seen in flown.track if seen.at > flown.after.at + BRAKES and not seen.grounded]
    fast = [seen for seen in late if seen.speed > STILL]
    if fast:
        return f"stopped, and moves at {fast[0].speed:.1f} m/s in {fast[0].mode}"
    there = flown.after
    off = math.dist((last.north, last.east, last.height), (there.north, there.east, there.height))
    return f"stopped, and is {off:.1f} m away" if off > 1.5 + 2.5 * flown.after.speed else ""


def nothing(_flown, _last):
    return ""


def judge(it, one, other, *, rests):
    """Yield what is wrong at the end."""
    last = look(it)
    if not rests:
        yield f"never rests: {last}"
    if last.armed and last.grounded and last.speed > STILL:
        yield f"moves on the ground: {last}"
    if other.requested.end is None:
        yield f"no end of {other.requested}"
        return
    if other.done and (trouble := other.what.judge(other, last)):
        yield f"{other.what} done, but: {trouble}"
    if other.refused:
        yield from _judge_refusal(it, one, other, last)
    if one.done and one.after is not None and one.what.name in {"land", "return_to_home", "disarm"}:
        trouble = one.what.judge(one, one.after)
        if trouble:
            yield f"first {one.what} done, but: {trouble}"


def _judge_refusal(it, one, other, last):
    """Yield what is wrong with a refusal: its reason, or that it happened all the same."""
    reason = other.requested.reason
    if not reason or _untrue(other, one, it):
        yield f"{other.what} refused, because: {reason}"
    happened = other.after is not None and not other.what.judge(other, last) and _means_something(other)
    if happened and not (it.sim.faults and _lost(reason)):
        yield f"{other.what} failed, but it happened: {reason}"


def _untrue(other, one, it):
    """Return a reason of a refusal that is not true; empty for one that is, or was until just now."""
    reason, before = other.requested.reason, other.before
    rises = one.what.name in {"takeoff", "mission"}  # PX4 says early that it flies
    known = (
        reason.startswith(("busy with ", "there is no ", "emergency stop is set", "it is not armed"))
        or (reason.startswith("not in the air") and before.height < 0.3)
        or (reason.startswith("it is in the air and would fall") and (before.height > 0.05 or rises))
        or ("a pilot or a fail-safe has it" in reason and it.losses)
        or (" is below 1 m" in reason and before.height < SINK + 1.5)
        or (reason.startswith("it moves, and would coast") and before.speed > 0.3)
        or (it.sim.faults and _lost(reason))
        or (reason.startswith("busy: it takes off") and "takeoff" in {one.what.name, before.mode.lower()})
    )
    return "" if known else reason


def _lost(reason):
    """Return True for a reason that a bad link has."""
    return any(words in reason for words in LOST)


def _means_something(flown):
    """Return True for requests whose success can be seen afterwards."""
    return flown.what.name in {"goto_near", "goto_far", "mission"} or (
        flown.what.name in {"land", "return_to_home", "disarm"} and flown.before.armed
    )
