"""Readiness of a vehicle for take-off, as a list of checks with the autopilot's own texts."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable

import msgspec

from fleet import CommandError, Refused
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.failsafe_causes import position_troubles
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.flight import Flight
from fleet_mavlink.messages import CommandLong, SysStatus
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.remote_id import trouble_of
from fleet_mavlink.state import Fix, VehicleState
from fleet_mavlink.statustext import WARNING, Sentence

_SAID_FOR = 35.0  # s; ArduPilot repeats what is wrong every 30 s
_REASONS = ("arm", "prearm", "preflight")  # with which an autopilot begins what keeps it from arming
_FOUND, _REFUSED = "prearm: ", "arm: "  # how ArduPilot begins what its checks find, and why it does not arm
_OF_THE_MODE = ("mode not armable", "AUTO missing takeoff waypoint")  # the latter of a QuadPlane after a plan
_MAY_BE_UNKNOWN = frozenset({"satellites", "battery"})
_WORDS_WITHIN = 0.5  # s after the checks were asked for
_BIT_WITHIN = 1.5  # s in which SYS_STATUS comes, once a second


class ReadinessCheck(msgspec.Struct, frozen=True):
    """One thing that a take-off needs; ``ok`` None: unknown. ``words`` say what is seen or wrong."""

    check: str
    ok: bool | None
    words: tuple[str, ...] = ()


def checks(
    state: VehicleState,
    flavour: Flavour,
    sentences: Iterable[Sentence],
    lost_to: str,
    now: float,
    *,
    requested: float = math.inf,
    needs_remote_id: bool = False,
) -> list[ReadinessCheck]:
    """Return the checks, in the order in which they become ok after power-on.

    ``requested``: when the autopilot was asked to check itself; what it says from then on is what it found.
    """
    mode = flavour.mode_of(state)
    fix, troubles = state.fix_now(now), position_troubles(state, now)
    percent = state.battery.percent
    sentences = [said for said in sentences if said.severity <= WARNING]  # of what is switched off, too
    standing = _standing(sentences, requested, now)
    against = tuple(each for each in standing if not _is_solved_by_takeoff(each, mode, flavour))
    is_reported = any(each.lower().startswith(_FOUND) for each in standing)  # all that it found
    passed = (is_reported or state.prearm_ok) and not against
    return [
        _satellites(state, fix, troubles),
        ReadinessCheck("home", state.home is not None),
        # troubles: in the words of its health
        ReadinessCheck("position", flavour.position_usable(state, now), troubles),
        ReadinessCheck(
            "autopilot's own checks", passed, () if passed else against or reasons(sentences, now)
        ),
        ReadinessCheck("mode", True, (_mode_words(mode, flavour),)),
        ReadinessCheck("fail-safe", not state.failsafe),
        ReadinessCheck("control", not lost_to, (f"taken in {lost_to}",) if lost_to else ()),
        *_remote_control(state),
        *_remote_id(state, now, wanted=needs_remote_id),
        ReadinessCheck("battery", None if percent is None else not state.failsafe, _percent_words(percent)),
    ]


def _satellites(state: VehicleState, fix: Fix | None, troubles: tuple[str, ...]) -> ReadinessCheck:
    """Look whether there is a fix; where there never was one the position may come from elsewhere."""
    if fix is None:
        return ReadinessCheck(
            "satellites", False if state.had_fix else None, troubles[:1] if state.had_fix else ()
        )
    count = "" if fix.satellites is None else f", {fix.satellites} satellites"
    return ReadinessCheck("satellites", True, (f"{fix.kind} fix{count}",))


def _is_solved_by_takeoff(words: str, mode: str, flavour: Flavour) -> bool:
    """Return whether what is said against arming is put right by each take-off: the mode, an old landing."""
    if words.endswith(_OF_THE_MODE):
        return mode != flavour.arming
    return bool(flavour.lands_once) and words.endswith(flavour.lands_once)


def _mode_words(mode: str, flavour: Flavour) -> str:
    """Return the mode, as text, in which the autopilot checked itself: ArduPilot's checks depend on it."""
    begins = "arming it" if flavour.surface else "a take-off"
    return mode if mode == flavour.arming else f"{mode}; {begins} changes to {flavour.arming}"


def _remote_control(state: VehicleState) -> tuple[ReadinessCheck, ...]:
    """Check whether the pilot's remote control is received, if the vehicle has a receiver."""
    heard = state.remote_control
    if heard is None:
        return ()
    return (ReadinessCheck("remote control", heard, () if heard else ("no signal from it is received",)),)


def _remote_id(state: VehicleState, now: float, *, wanted: bool) -> tuple[ReadinessCheck, ...]:
    """Look whether the Remote ID transmitter allows a take-off, where there is one or must be one."""
    trouble = trouble_of(state, now, wanted=wanted)
    return (
        () if trouble is None else (ReadinessCheck("remote ID", not trouble, (trouble,) if trouble else ()),)
    )


def _percent_words(percent: float | None) -> tuple[str, ...]:
    """Say how full the battery is."""
    return () if percent is None else (f"{percent:.0f} %",)


def reasons(sentences: Iterable[Sentence], now: float) -> tuple[str, ...]:
    """Return the autopilot's recent texts about arming, without duplicates, oldest first."""
    lately = (said.text for said in sentences if now - said.at <= _SAID_FOR)
    return tuple(dict.fromkeys(text for text in lately if text.lower().startswith(_REASONS)))


def _standing(sentences: Iterable[Sentence], requested: float, now: float) -> tuple[str, ...]:
    """Return what ArduPilot says against arming now, whatever its bit shows, which is up to 1 s behind.

    ``requested``: time of the request to check itself. What it finds only when armed, such as a log that
    does not open, counts for a while: some seconds later its checks find nothing again.
    """
    said = [(each.text, each.text.lower(), each.at) for each in sentences]
    found = {text.removeprefix(_FOUND) for _, text, _ in said if text.startswith(_FOUND)}
    return tuple(
        dict.fromkeys(
            words
            for words, text, at in said
            if (text.startswith(_FOUND) and at >= requested)
            or (
                text.startswith(_REFUSED)
                and at >= now - _SAID_FOR
                and text.removeprefix(_REFUSED) not in found
            )
        )
    )


def is_ready(found: Iterable[ReadinessCheck]) -> bool:
    """Return True when nothing prevents a take-off; satellites and battery may be unknown."""
    return all(check.ok or (check.ok is None and check.check in _MAY_BE_UNKNOWN) for check in found)


async def inspect(flight: Flight) -> list[ReadinessCheck]:
    """Let the autopilot check itself, and return the list; raises NotReady when it does not answer."""
    vehicle = flight.vehicle
    require_connection(vehicle)
    if vehicle.state.armed:
        raise Refused("it is armed: it was ready")
    requested = vehicle.now()
    try:
        await flight.commander.request(CommandLong(MavCmd.RUN_PREARM_CHECKS), tries=1)
        answered = vehicle.now()
        await asyncio.sleep(_WORDS_WITHIN)
        await vehicle.until(lambda _: vehicle.seen_at.get(SysStatus, 0.0) > answered, _BIT_WITHIN)
    except CommandError:
        requested = math.inf  # without the command it sends its reasons unasked, only less often
    lost_to = flight.authority.lost_to
    said, wanted = tuple(vehicle.sentences), vehicle.needs_remote_id
    return checks(
        vehicle.state,
        flight.flavour,
        said,
        lost_to,
        vehicle.now(),
        requested=requested,
        needs_remote_id=wanted,
    )
