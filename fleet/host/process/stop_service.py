"""Serves the stop key: emergency stops for a robot, a group, an edge, or everything.

Published or queried on ``fleet/*/stop`` with a JSON list of names; an empty list, or no payload, means all.
The sender may give its name and a reason (``stop_cause``).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.bus.zenoh_session import Query
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import StopCause, cause_in, cause_noted
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

LARGEST = 1 << 20  # bytes; a larger stop is not decoded for names and stops everything


class RemoteStopTarget(Protocol):
    """A robot of the edge in another process, which receives the stop key itself if it is alive."""

    name: str

    def stop_later(self, cause: StopCause) -> None:
        """Keep the stop for a process that does not receive it now; from any thread."""

    def emergency(self, cause: StopCause) -> None:
        """Stop it over the bus, and keep the stop; from any thread. Never raises."""


def serve_stops(
    process: RobotProcess,
    bus: Bus,
    groups: Mapping[str, list[str]],
    remote: Iterable[RemoteStopTarget] = (),
) -> Callable[[bytes, StopCause], list[str]]:
    """Stop this process's robots when the stop key is published or queried; on the bus's threads.

    Returns a function that does the same for other callers, from any thread, with the payload of the key and
    the cause. The processes of the robots ``remote`` do not see those calls, so it also publishes the stop
    for them. ``groups`` and ``remote`` may change meanwhile.
    """
    key = keys.stop(process.edge)

    def stop(payload: bytes, cause: StopCause) -> list[str]:
        names = names_in(payload, groups)
        stopped = _stop_here(process, names, cause)
        for robot in list(remote):
            if not names or robot.name in names:
                _keep(robot, cause)
        return stopped

    def requested(question: Query) -> None:
        stopped = stop(question.payload, cause_in(question.parameters))
        question.reply(msgspec.json.encode(stopped))
        question.close()

    def published(payload: bytes, note: bytes) -> None:
        stop(payload, cause_noted(note))

    for bus_session in (bus.control, bus.reports):
        bus_session.subscribe_noted(key, published)
    bus.control.declare_queryable(key, requested)
    return lambda payload, cause: stop_everywhere(process, remote, names_in(payload, groups), cause)


def _stop_here(process: RobotProcess, names: tuple[str, ...], cause: StopCause) -> list[str]:
    """Stop robots of this process; a failure must not prevent the stop of those elsewhere."""
    try:
        return process.stop_robots(names, cause)
    except Exception:
        log.exception("the emergency stop failed in this process")
        return []


def _keep(robot: RemoteStopTarget, cause: StopCause) -> None:
    """Keep a stop for a robot of another process; a failure must not prevent the others' stop."""
    try:
        robot.stop_later(cause)
    except Exception:
        log.exception("the stop of %s could not be kept for its process", robot.name)


def stop_everywhere(
    process: RobotProcess, remote: Iterable[RemoteStopTarget], names: tuple[str, ...], cause: StopCause
) -> list[str]:
    """Stop robots of this process and those elsewhere, from any thread; no name means all.

    Returns the robots stopped in this process. A failure here is logged, and does not prevent the others'
    stop.
    """
    stopped = _stop_here(process, names, cause)
    for robot in list(remote):
        if not names or robot.name in names:
            robot.emergency(cause)
    return stopped


def replace_groups(groups: dict[str, list[str]], by: Mapping[str, Iterable[str]]) -> None:
    """Replace groups in place; a concurrent stop always finds each group that stays, old or new."""
    for name, robots in by.items():
        groups[name] = list(robots)
    for name in groups.keys() - by.keys():
        del groups[name]


def merged_groups(
    one: Mapping[str, Iterable[str]], other: Mapping[str, Iterable[str]]
) -> dict[str, list[str]]:
    """Return groups with the robots of both."""
    return {name: [*dict.fromkeys((*one.get(name, ()), *other.get(name, ())))] for name in {**one, **other}}


def names_in(payload: bytes, groups: Mapping[str, list[str]]) -> tuple[str, ...]:
    """Return the robots that a stop names, with groups expanded; empty means all.

    An invalid payload, or one too long for a list of names, stops everything: a stop is never lost to a bad
    parameter. A robot's name may be prefixed with its edge.
    """
    if len(payload) > LARGEST:
        return ()
    try:
        given = decode_json(payload, list[str]) if payload else []
    except (ValueError, RecursionError):  # includes msgspec's own errors
        return ()
    plain = (one.strip().casefold().rpartition("/")[2] for one in given)
    # A group's name stays beside its members: an empty group must not turn into an empty list (all robots).
    return (*given, *(name for one in plain for name in (one, *groups.get(one, ()))))
