"""Fills the roles of a mission from the available robots; pure.

Robots with the fullest battery come first, ties by name. Roles with the fewest candidates choose first, each
up to its minimum; the other robots fill the roles up to their maximum.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from fleet.errors import Refused
from fleet.missions.facts import RobotFacts
from fleet.missions.model import RoleConfig
from fleet.missions.plan import missing_text
from fleet.missions.program import Require
from fleet.missions.state import Facts


class RoleCandidate(msgspec.Struct, frozen=True):
    """A robot that may fill a role. ``can``: its commands, and goto, path and plan if it supports them.

    ``trouble`` is why it cannot take part in any run now, else empty. ``run`` is its present run.
    """

    name: str
    kind: str
    can: frozenset[str]
    facts: Facts
    groups: frozenset[str] = frozenset()
    trouble: str = ""
    run: str = ""


def filled(
    roles: Mapping[str, RoleConfig],
    needs: Mapping[str, frozenset[str]],
    candidates: Iterable[RoleCandidate],
    require: Require,
    given: Mapping[str, Sequence[str]],
) -> dict[str, list[str]]:
    """Return robots by role; if a role cannot be filled, raise Refused with the reason for each candidate.

    ``needs`` are the needs of the steps by role; ``given`` are robots chosen by a person.
    """
    all_robots = sorted(candidates, key=_fullest)
    lacking = {
        role: {
            each.name: _lacks(each, wanted, needs.get(role, frozenset()), require, given.get(role))
            for each in all_robots
        }
        for role, wanted in roles.items()
    }
    able = {role: [name for name, why in lacks.items() if not why] for role, lacks in lacking.items()}
    order = sorted(roles, key=lambda role: (len(able[role]) - roles[role].count.min, role))
    found: dict[str, list[str]] = {role: [] for role in roles}
    taken: set[str] = set()
    for least in (True, False):
        for role in order:
            count = roles[role].count
            free = [name for name in able[role] if name not in taken]
            more = free[: (count.min if least else count.max) - len(found[role])]
            found[role] += more
            taken |= set(more)
            if least and len(found[role]) < count.min:
                raise Refused(_unfilled_reason(role, count.min, found[role], lacking[role], taken))
    return found


def spares(
    roles: Mapping[str, RoleConfig],
    needs: Mapping[str, frozenset[str]],
    candidates: Iterable[RoleCandidate],
    require: Require,
    given: Mapping[str, Sequence[str]],
    *,
    taken: Iterable[str],
) -> dict[str, list[str]]:
    """Return spare robots by role, without those of ``taken``.

    ``given`` are robots chosen by a person. Fewer than the role asks for are no error.
    """
    all_robots, used = sorted(candidates, key=_fullest), set(taken)
    found: dict[str, list[str]] = {}
    for role, wanted in roles.items():
        if wanted.spares:
            name, need = spare_of(role), needs.get(role, frozenset())
            able = [
                each.name for each in all_robots if not _lacks(each, wanted, need, require, given.get(name))
            ]
            found[name] = [each for each in able if each not in used][: wanted.spares]
            used |= set(found[name])
    return found


def spare_of(role: str) -> str:
    """Return the name under which the spares of a role are shown and chosen."""
    return f"spare {role}"


def conflicting_runs(
    roles: Mapping[str, RoleConfig],
    needs: Mapping[str, frozenset[str]],
    candidates: Iterable[RoleCandidate],
    require: Require,
    given: Mapping[str, Sequence[str]],
) -> set[str]:
    """Return a minimal set of runs that must end before the roles can be filled.

    Raises Refused if they cannot be filled even then.
    """
    all_robots = list(candidates)

    def fill_without(ended: set[str]) -> None:
        free = [msgspec.structs.replace(each, run="") if each.run in ended else each for each in all_robots]
        filled(roles, needs, free, require, given)

    ended = {each.run for each in all_robots if each.run}
    fill_without(ended)
    for run in sorted(ended):
        with contextlib.suppress(Refused):
            fill_without(ended - {run})
            ended = ended - {run}
    return ended


def matches_role(candidate: RoleCandidate, role: RoleConfig, given: Sequence[str] | None = None) -> bool:
    """Return True if a robot matches a role; ``given`` are robots chosen by a person."""
    wanted = role.from_ in (None, candidate.name) or role.from_ in candidate.groups
    if given is not None:
        wanted = candidate.name in given
    return wanted and role.kind in (None, candidate.kind)


def _fullest(candidate: RoleCandidate) -> tuple[float, str]:
    """Sort key: by battery, the fullest first, then by name."""
    battery = candidate.facts.battery
    return (-1.0 if battery is None else -battery, candidate.name)


def _lacks(
    candidate: RoleCandidate,
    role: RoleConfig,
    needs: frozenset[str],
    require: Require,
    given: Sequence[str] | None,
) -> str:
    """Return why a robot does not fit a role; empty if it does, ``-`` if the role does not ask for it."""
    if not matches_role(candidate, role, given):
        return "-"
    missing = (needs | frozenset(role.can)) - candidate.can
    if missing:
        return missing_text(missing)
    if candidate.trouble or candidate.run:
        return candidate.trouble or f"it is in run {candidate.run}"
    seen = RobotFacts()
    seen.replace(candidate.facts)
    return seen.lacks(candidate.name, require)


def _unfilled_reason(
    role: str, least: int, found: list[str], lacking: Mapping[str, str], taken: set[str]
) -> str:
    """Describe why a role cannot be filled, with the reason for each candidate."""
    words = [
        f"{name}: {why or 'fills another role'}"
        for name, why in lacking.items()
        if why != "-" and (why or (name in taken and name not in found))
    ]
    return f"role {role} needs {least}, {len(found)} can: {'; '.join(words) or 'no robot is asked for'}"
