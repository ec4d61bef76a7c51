"""Serves the stop key: emergency stops for a robot, a group, an edge, or everything there is.

Published or asked on ``fleet/*/stop`` with a JSON list of names; an empty list, or nothing, means all. Who
asks may say so, and why, beside it (``stop_cause``).
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

LARGEST = 1 << 20  # bytes of a stop that is read for names


class RemoteStopTarget(Protocol):
    """A robot of the edge in another process, which hears the stop key itself if it lives."""

    name: str

    def stop_later(self, cause: StopCause) -> None:
        """Remember the stop for a process that does not hear it now; from any thread."""

    def emergency(self, cause: StopCause) -> None:
        """Stop it over the bus, and remember the stop; from any thread. Never raises."""


def serve_stops(
    process: RobotProcess,
    bus: Bus,
    groups: Mapping[str, list[str]],
    elsewhere: Iterable[RemoteStopTarget] = (),
) -> Callable[[bytes, StopCause], list[str]]:
    """Stop this process's robots when the stop key is published or asked; on the bus's threads.

    Returns what does so for whoever else asks, from any thread: it takes what the key would, and the cause.
    Of that the processes of the robots ``elsewhere`` hear nothing, so it is put on the stop key for them.
    ``groups`` and ``elsewhere`` may change meanwhile.
    """
    key = keys.stop(process.edge)

    def stop(payload: bytes, cause: StopCause) -> list[str]:
        names = names_in(payload, groups)
        for robot in list(elsewhere):
            if not names or robot.name in names:
                robot.stop_later(cause)
        return process.stop_robots(names, cause)

    def asked(question: Query) -> None:
        stopped = stop(question.payload, cause_in(question.parameters))
        question.reply(msgspec.json.encode(stopped))
        question.close()

    def published(payload: bytes, note: bytes) -> None:
        stop(payload, cause_noted(note))

    for bus_session in (bus.control, bus.reports):
        bus_session.subscribe_noted(key, published)
    bus.control.answer(key, asked)
    return lambda payload, cause: stop_everywhere(process, elsewhere, names_in(payload, groups), cause)


def stop_everywhere(
    process: RobotProcess, elsewhere: Iterable[RemoteStopTarget], names: tuple[str, ...], cause: StopCause
) -> list[str]:
    """Stop robots of this process and those elsewhere, from any thread; no name means all.

    Returns who was stopped in this process. A failure here is logged, and keeps nobody elsewhere moving.
    """
    try:
        stopped = process.stop_robots(names, cause)
    except Exception:
        log.exception("the emergency stop failed in this process")
        stopped = []
    for robot in list(elsewhere):
        if not names or robot.name in names:
            robot.emergency(cause)
    return stopped


def replace_groups(groups: dict[str, list[str]], by: Mapping[str, Iterable[str]]) -> None:
    """Have other groups; a stop on another thread finds each that stays, old or new, all the time."""
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
    """Return the robots that a stop names, groups spelt out; none means all.

    What cannot be read stops everything, and so does what is too long to be a list of names: a stop is
    never lost to its trimmings. A robot's edge may stand before its name.
    """
    if len(payload) > LARGEST:
        return ()
    try:
        given = decode_json(payload, list[str]) if payload else []
    except (ValueError, RecursionError):  # of which msgspec's own errors are some
        return ()
    plain = (one.strip().casefold().rpartition("/")[2] for one in given)
    # A name stays beside its members: an empty group must not come to mean everything.
    return (*given, *(name for one in plain for name in (one, *groups.get(one, ()))))
