"""Comparison of an adapter's reports in a replay with the recorded ones; pure."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import msgspec

from fleet.replay.recorded_robot import RecordedReport

TICK = 0.02
"""Tolerance of a report's time in seconds: reports are published once per tick, the newest each."""
EXACT = 1e-6
"""Tolerance of a number: the time of a frame is known to a microsecond."""
EVENTS = ("driverlog", "telemetry", "navigate_status", "event")
"""Channels on which the host reports as well: recorded reports there may not be the adapter's."""


class Difference(msgspec.Struct, frozen=True):
    """One report that differs from the recorded one: Unix s, channel, and the members that differ."""

    at: float
    robot: str
    channel: str
    what: str

    def __str__(self) -> str:
        return f"{self.at:.3f} {self.robot} {self.channel}: {self.what}"


def differences(
    robot: str,
    recorded: Mapping[str, Sequence[RecordedReport]],
    now: Mapping[str, Sequence[RecordedReport]],
    *,
    since: float = -math.inf,
    tolerance: Mapping[str, float] = MappingProxyType({}),
) -> Iterator[Difference]:
    """Yield the differences from ``since`` (Unix s), by channel and time.

    Each recorded report must occur in the replay within a tick, with the same content; of several in one
    tick, the recorder has one. A report on a channel that was not recorded at all is a difference too.
    ``tolerance`` is the relative tolerance of numbers, by the name of their member.
    """
    for channel in sorted(recorded.keys() | now.keys()):
        before, after = recorded.get(channel, ()), sorted(now.get(channel, ()), key=_stamp)
        if _is_event(channel):
            before, after = after, sorted(before, key=_stamp)
        elif not before and after and after[-1].stamp >= since:
            yield Difference(after[0].stamp, robot, channel, "was not recorded, and is reported now")
        if _is_event(channel) and channel not in now:
            continue
        times = [said.stamp for said in after]
        for said in before:
            if said.stamp < since:
                continue
            what = _missing(said, after, times, tolerance, is_event=_is_event(channel))
            if what:
                yield Difference(said.stamp, robot, channel, what)


def _stamp(said: RecordedReport) -> float:
    """Return the stamp of a report."""
    return said.stamp


def _is_event(channel: str) -> bool:
    """Return True if the host reports on a channel as well."""
    return channel.partition(":")[0] in EVENTS


def _missing(
    said: RecordedReport,
    others: Sequence[RecordedReport],
    times: Sequence[float],
    tolerance: Mapping[str, float],
    *,
    is_event: bool,
) -> str:
    """Return the difference if no other report within a tick has the same content; else empty."""
    first = bisect_left(times, said.stamp - TICK)
    last = bisect_left(times, said.stamp + TICK)
    found = ["; ".join(unequal(said.content, other.content, tolerance)) for other in others[first:last]]
    if any(not each for each in found):
        return ""
    if is_event:
        return f"was not recorded: {said.content}"
    return min(found, key=len) if found else "was recorded, and is not reported now"


def unequal(
    recorded: Any, now: Any, tolerance: Mapping[str, float] = MappingProxyType({}), where: str = ""
) -> Iterator[str]:
    """Yield the differing members of two JSON values as text; ``tolerance`` as for ``differences``."""
    if isinstance(recorded, Mapping) and isinstance(now, Mapping):
        for name in dict.fromkeys((*recorded, *now)):
            path = f"{where}.{name}" if where else name
            yield from unequal(recorded.get(name), now.get(name), tolerance, path)
    elif isinstance(recorded, list) and isinstance(now, list) and len(recorded) == len(now):
        for number, (one, other) in enumerate(zip(recorded, now, strict=True)):
            yield from unequal(one, other, tolerance, f"{where}[{number}]")
    elif not _is_same(recorded, now, tolerance.get(where.rpartition(".")[2], EXACT)):
        yield f"{where}: recorded {recorded!r}, now {now!r}"


def _is_same(one: Any, other: Any, share: float) -> bool:
    """Return True if two plain values are equal, numbers within a tolerance."""
    numbers = (int, float)
    if isinstance(one, numbers) and isinstance(other, numbers):
        return math.isclose(one, other, rel_tol=share, abs_tol=EXACT)
    return bool(one == other)
