"""Who would fill the roles of a mission now, which runs are in its way, and what people are shown of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import msgspec

from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.missions.grammar_words import role_words, step_words
from fleet.missions.model import ALL, CountConfig, RoleConfig
from fleet.missions.plan import plan_needs
from fleet.missions.program import Act, Do, Program, RoleNeed
from fleet.missions.rehearsal import Point
from fleet.missions.report import MissionState, StartAsk
from fleet.missions.roles import Candidate, filled, is_meant, runs_in_the_way, spare_of, spares
from fleet.missions.run import Run
from fleet.missions.state import Member

Rehearsed = Callable[[Program, dict[str, list[str]] | None, dict[str, Point | None]], str]
"""Why a mission may not be started by what was rehearsed, by its robots by role and where robots are."""


class Filling:
    """Fills roles from the robots of an edge. ``runs``: those under way, and those that are beginning.

    ``is_full`` says whether a place is taken up to its capacity.
    """

    def __init__(
        self,
        candidates: Callable[[], list[Candidate]],
        runs: Callable[[], Iterable[Run]],
        is_full: Callable[[str], bool],
    ) -> None:
        self._candidates = candidates
        self._runs = runs
        self._is_full = is_full
        self.rehearsed: Rehearsed = lambda *_: "rehearsals are not kept here"

    def fill(
        self, mission: Mission, program: Program, ask: StartAsk, *, rehearses: bool = False
    ) -> dict[str, list[str]]:
        """Return who would fill the roles of a mission; raises Refused.

        Also where it must be rehearsed and was not, unless this is for a rehearsal.
        """
        needs, free = needs_of(program), self._free(ask.run)
        found = filled(mission.config.roles, needs, free, program.require, ask.robots)
        taken = [robot for robots in found.values() for robot in robots]
        found |= spares(mission.config.roles, needs, free, program.require, ask.robots, taken=taken)
        for inner in program.inner.values():
            carriers = roles_of(inner.carrier, found)
            robots = {robot for role in carriers for robot in found[role]}
            theirs = [each for each in free if each.name in robots]
            wanted = {name: _config_of(need) for name, need in inner.roles.items()}
            found |= filled(wanted, needs, theirs, inner.require, ask.robots)
        if not rehearses:
            self._require_rehearsal(mission, program, ask, found)
        return found

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
            if any(map(self._is_full, places)) or run.about.mission == program.mission:
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


def roles_of(role: str, roles: Iterable[str]) -> list[str]:
    """Return the roles that a name stands for: itself, or with ``all`` those of its mission."""
    scope, _, name = role.rpartition(".")
    return (
        [role]
        if name != ALL
        else [each for each in roles if each.rpartition(".")[0] == scope and " " not in each]
    )


def members_of(program: Program, roles: Mapping[str, Iterable[str]]) -> list[Member]:
    """Return the robots of a run; ``roles`` are those of its mission and of the missions within it."""
    plays: dict[str, dict[str, int]] = {}
    for inner, mission in program.inner.items():
        for role in mission.roles:
            for at, robot in enumerate(roles[role]):
                plays.setdefault(robot, {}).update({role: at, f"{inner}.{ALL}": at})
    members = [
        Member(robot, role, at, plays.get(robot, {}))
        for role in program.quorum
        for at, robot in enumerate(roles[role])
    ]
    waiting = [
        Member(robot, role, 0, ours=False, within=False, spare=True)
        for role in program.quorum
        for robot in roles.get(spare_of(role), ())
    ]
    return members + waiting


def _config_of(need: RoleNeed) -> RoleConfig:
    """Return who fills a role of a mission within the mission."""
    count = CountConfig(min=need.least, max=need.most)
    return RoleConfig.model_validate(
        {"from": need.source, "kind": need.kind, "can": need.can, "count": count}
    )


def needs_of(program: Program) -> dict[str, frozenset[str]]:
    """Return what the steps ask of each role: commands by name, goto, path and plan.

    A role that carries a mission with one role needs what that needs; of one with several roles, what its
    robots are good for is seen when these are filled from them.
    """
    needs: dict[str, set[str]] = {role: set() for role in program.quorum}
    needs |= {role: set() for inner in program.inner.values() for role in inner.roles}
    for step in program.steps:
        if not isinstance(step, Do):
            continue
        for acts in (step.acts, step.undo):
            for role, each in acts.items():
                words = {word for act in each for word in _need_of(act)}
                for name in roles_of(role, needs):
                    needs[name] |= words
    for inner in reversed(program.inner.values()):
        if len(inner.roles) == 1:
            for name in roles_of(inner.carrier, needs):
                needs[name] |= needs[next(iter(inner.roles))]
    return {role: frozenset(words) for role, words in needs.items()}


def _need_of(act: Act) -> set[str]:
    """Return what a robot must take to do something."""
    if act.verb == "plan":
        return plan_needs(act.value)
    return {str(act.value) if act.verb == "command" else act.verb}


def mission_state(mission: Mission, edge: str) -> MissionState:
    """Return what people are shown of a mission."""
    config = mission.config
    return MissionState(
        mission.name,
        edge,
        config.summary,
        {name: _words(each.type, each.unit, each.default) for name, each in config.inputs.items()},
        {name: role_words(role) for name, role in config.roles.items()},
        tuple(map(step_words, config.steps)),
    )


def _words(kind: str, unit: str, default: object) -> str:
    """Return an input in words."""
    words = f"{kind} {unit}".strip()
    return words if default is None else f"{words}, {default} when left out"
