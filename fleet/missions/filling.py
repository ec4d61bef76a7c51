"""Who would fill the roles of a mission now, which runs are in its way, and what people are shown of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import msgspec

from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.missions.program import Do, Program
from fleet.missions.rehearsal import Point
from fleet.missions.report import MissionState, StartAsk
from fleet.missions.roles import Candidate, filled, is_meant, runs_in_the_way
from fleet.missions.run import Run

Rehearsed = Callable[[Program, dict[str, list[str]] | None, dict[str, Point | None]], str]
"""Why a mission may not be started by what was rehearsed, by its robots by role and where robots are."""


class Filling:
    """Fills roles from the robots of an edge. ``runs``: those under way, and those that are beginning."""

    def __init__(self, candidates: Callable[[], list[Candidate]], runs: Callable[[], Iterable[Run]]) -> None:
        self._candidates = candidates
        self._runs = runs
        self.rehearsed: Rehearsed = lambda *_: "rehearsals are not kept here"

    def fill(
        self, mission: Mission, program: Program, ask: StartAsk, *, rehearses: bool = False
    ) -> dict[str, list[str]]:
        """Return who would fill the roles of a mission; raises Refused.

        Also where it must be rehearsed and was not, unless this is for a rehearsal.
        """
        needs, free = needs_of(program), self._free(ask.run)
        roles = filled(mission.config.roles, needs, free, program.require, ask.robots)
        if not rehearses:
            self._require_rehearsal(mission, program, ask, roles)
        return roles

    def _require_rehearsal(
        self, mission: Mission, program: Program, ask: StartAsk, roles: dict[str, list[str]] | None
    ) -> None:
        """Raise Refused for a mission that must be rehearsed and was not; ``roles``: None while not known."""
        if mission.config.rehearse != "required":
            return
        places = {each.name: each.facts.position for each in self._candidates()}
        why = self.rehearsed(program, roles, places)
        if why:
            raise Refused(f"it must be rehearsed first, and {why}", hint=rehearse_command(mission.name, ask))

    def in_the_way(self, mission: Mission, program: Program, ask: StartAsk) -> list[str]:
        """Return the runs of the same mission, at its places, and with robots that it needs.

        Raises Refused where it could not be started even if they ended.
        """
        self._require_rehearsal(mission, program, ask, None)
        needs, free = needs_of(program), self._free(ask.run)
        found = runs_in_the_way(mission.config.roles, needs, free, program.require, ask.robots)
        for run in self._runs():
            places = set(program.occupies) & set(run.engine.program.occupies)
            if places or run.about.mission == program.mission:
                found.add(run.id)
        return sorted(found - {ask.run})

    def left_out(self, mission: Mission, roles: Mapping[str, Iterable[str]]) -> set[str]:
        """Return the robots that a mission's roles ask for, and that fill none of them."""
        taken = {robot for robots in roles.values() for robot in robots}
        asked = mission.config.roles.values()
        meant = {each.name for each in self._candidates() if any(is_meant(each, role) for role in asked)}
        return meant - taken

    def _free(self, run: str) -> list[Candidate]:
        """Return what each robot can and is now; one that has joined ``run`` already is free for it.

        After a restart robots belong to the runs that are taken up, before they know it themselves.
        """
        has = {member.robot: each.id for each in self._runs() for member in each.engine.robots.ours()}
        found = []
        for each in self._candidates():
            now = has.get(each.name, each.run)
            found.append(msgspec.structs.replace(each, run="" if now == run else now))
        return found


def rehearse_command(name: str, ask: StartAsk) -> str:
    """Return what a person types to rehearse what was asked for."""
    words = ["fleet mission rehearse", name if ask.mission is None else "FILE"]
    words += [f"{key}={value}" for key, value in ask.inputs.items()]
    words += [f"--robot {role}={robot}" for role, robots in ask.robots.items() for robot in robots]
    return " ".join(words)


def needs_of(program: Program) -> dict[str, frozenset[str]]:
    """Return what the steps ask of each role: commands by name, goto, path and plan."""
    needs: dict[str, set[str]] = {role: set() for role in program.quorum}
    for step in program.steps:
        if not isinstance(step, Do):
            continue
        for acts in (step.acts, step.undo):
            for role, each in acts.items():
                words = {str(act.value) if act.verb == "command" else act.verb for act in each}
                for name in needs if role == "all" else (role,):
                    needs[name] |= words
    return {role: frozenset(words) for role, words in needs.items()}


def mission_state(mission: Mission, edge: str) -> MissionState:
    """Return what people are shown of a mission."""
    config = mission.config
    return MissionState(
        mission.name,
        edge,
        config.summary,
        {name: _words(each.type, each.unit, each.default) for name, each in config.inputs.items()},
        {
            name: f"{role.count.min} to {role.count.max} of {role.from_ or 'any'}"
            for name, role in config.roles.items()
        },
        tuple(step.id for step in config.steps),
    )


def _words(kind: str, unit: str, default: object) -> str:
    """Return an input in words."""
    words = f"{kind} {unit}".strip()
    return words if default is None else f"{words}, {default} when left out"
