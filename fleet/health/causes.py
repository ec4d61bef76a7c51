"""Causes of unhealthy robots, folded: robots with a common cause are one trouble. Pure.

Causes are equal if they differ only in measured figures, in the robot's own name, or in the number of the
device (three robots whose adapters hang on one USB hub lose ttyUSB3, ttyUSB4 and ttyUSB5 together).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from fleet.model.health import Health, Level
from fleet.model.state import RobotState
from fleet.model.summary import LISTED, LONGEST_CAUSE, LONGEST_LINK, NAMED, Trouble, weight, word_of

_LINK = re.compile(r"(?:bus '[^']*' \()?([a-z]+:[^\s()]+)\)?: (.+)", re.DOTALL)
_WORKER = re.compile(r"(worker [^\s:]+): (.+)", re.DOTALL)
_FIGURE = re.compile(r"\d+(?:\.\d+)?(?= ?(?:%|(?:s|ms|min|h|m|V)\b))")
_DEVICE = re.compile(r"(?<=[a-zA-Z])\d+(?=$|[:@,?\s])")


class CauseParts(NamedTuple):
    """A cause in two parts: ``link`` is the link or worker that it names, ``why`` the rest."""

    link: str
    why: str


def split_cause(cause: str) -> CauseParts:
    """Split a cause into link or worker (``serial:/dev/ttyUSB3``, ``worker arms``), and the rest."""
    found = _LINK.fullmatch(cause) or _WORKER.fullmatch(cause)
    return CauseParts(found[1], found[2]) if found else CauseParts("", cause)


def folded(text: str) -> str:
    """Return a cause without measured figures, which change while it stays the same."""
    return _FIGURE.sub("#", text)


class Onsets:
    """Since when (Unix s) each robot has its present health, and the edge each problem of its services."""

    def __init__(self) -> None:
        self._robots: dict[str, tuple[str, float]] = {}
        self._services: dict[str, float] = {}

    def note(self, states: Iterable[RobotState], services: Iterable[Health], now: float) -> None:
        """Update with the present healths."""
        known = self._robots
        self._robots = {
            state.name: known[state.name]
            if state.name in known and known[state.name][0] == state.health
            else (state.health, now)
            for state in states
        }
        causes = {folded(health.cause) for health in services if health.level is not Level.OK}
        self._services = {cause: self._services.get(cause, now) for cause in causes}

    def of_robot(self, name: str) -> float:
        """Return since when a noted robot has its health."""
        return self._robots[name][1]

    def of_service(self, cause: str) -> float:
        """Return since when a noted problem exists."""
        return self._services[folded(cause)]


def troubles_of(
    states: Iterable[RobotState], services: Iterable[Health], onsets: Onsets, links: Mapping[str, str]
) -> tuple[tuple[Trouble, ...], int]:
    """Return the most important causes, oldest first, and the number of the others.

    ``services`` are the healths of the edge's own services; they and the robots are noted in ``onsets``.
    ``links`` has the link of each robot in fleet.yaml.
    """
    groups: dict[tuple[str, str, str], list[tuple[RobotState, CauseParts]]] = {}
    for state in states:
        if state.health != Level.OK.word:
            part = _with_link(split_cause(state.cause), links.get(state.name, ""))
            why = folded(without_name(part.why, state.name))
            key = (state.health, _DEVICE.sub("#", part.link), why)
            groups.setdefault(key, []).append((state, part))
    found = [_trouble(key[0], group, onsets) for key, group in groups.items()]
    found += [
        Trouble(
            word_of(health),
            _cut(health.cause, LONGEST_CAUSE),
            onsets.of_service(health.cause),
        )
        for health in services
        if health.level is not Level.OK
    ]
    found.sort(key=weight, reverse=True)
    return tuple(sorted(found[:LISTED], key=lambda each: each.since)), len(found[LISTED:])


def _with_link(part: CauseParts, configured: str) -> CauseParts:
    """Complete a part with the link in fleet.yaml, if the cause names none."""
    return part if part.link or not configured else CauseParts(configured, part.why)


def without_name(text: str, name: str) -> str:
    """Return a cause with the robot's name replaced by ROBOT."""
    return re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", "ROBOT", text)


def _trouble(level: str, group: Sequence[tuple[RobotState, CauseParts]], onsets: Onsets) -> Trouble:
    """Return the robots of one cause as one trouble."""
    states = [state for state, _ in group]
    kinds = {state.adapter for state in states}
    links = list(dict.fromkeys(part.link for _, part in group))
    why = group[0][1].why if len(group) == 1 else without_name(group[0][1].why, states[0].name)
    return Trouble(
        word_of(level),
        _cut(why or level, LONGEST_CAUSE),
        min(onsets.of_robot(state.name) for state in states),
        robots=len(states),
        kind=_cut(kinds.pop(), 63) if len(kinds) == 1 else "",
        link=_cut(_together(links), LONGEST_LINK),
        names=tuple(_cut(state.name, 63) for state in states[:NAMED]),
    )


def _together(links: Sequence[str]) -> str:
    """Return links that differ only in the number of the device, as one text."""
    first, *others = links
    return first if not others else f"{first} and {len(others)} more"


def _cut(text: str, longest: int) -> str:
    """Return text truncated to a length."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
