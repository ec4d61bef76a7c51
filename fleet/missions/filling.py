"""Robots for the roles of a mission now, conflicting runs, and the mission's description for users."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping

import msgspec

from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.missions.grammar_words import role_words, step_words
from fleet.missions.model import ALL, CountConfig, RoleConfig
from fleet.missions.plan import plan_needs
from fleet.missions.program import Act, Do, Program, RoleNeed
from fleet.missions.rehearsal import TrackPoint
from fleet.missions.report import MissionStartRequest, MissionState
from fleet.missions.roles import RoleCandidate, conflicting_runs, filled, matches_role, spare_of, spares
from fleet.missions.run import Run
from fleet.missions.state import RunMember

Rehearsed = Callable[[Program, dict[str, list[str]] | None, dict[str, TrackPoint | None]], str]
"""Returns why a mission may not start without a rehearsal, from its robots by role and their positions."""


class Filling:
    """Fills roles from the robots of an edge. ``runs``: those in progress or about to begin.

    ``is_full``: whether a place is occupied up to its capacity. ``ended``: IDs of runs that have ended.
    """

    def __init__(
        self,
        candidates: Callable[[], list[RoleCandidate]],
        runs: Callable[[], Iterable[Run]],
        is_full: Callable[[str], bool],
        ended: Container[str] = (),
    ) -> None:
        self._candidates = candidates
        self._runs = runs
        self._is_full = is_full
        self._ended = ended
        self.rehearsed: Rehearsed = lambda *_: "rehearsals are not kept here"

    def fill(
        self, mission: Mission, program: Program, request: MissionStartRequest, *, rehearses: bool = False
    ) -> dict[str, list[str]]:
        """Return the robots for the roles of a mission; raises Refused.

        Also if a required rehearsal is missing, unless this is for a rehearsal.
        """
        needs, free = needs_of(program), self._free(request.run)
        found = filled(mission.config.roles, needs, free, program.require, request.robots)
        taken = [robot for robots in found.values() for robot in robots]
        found |= spares(mission.config.roles, needs, free, program.require, request.robots, taken=taken)
        for inner in program.inner.values():
            carriers = roles_of(inner.carrier, found)
            robots = {robot for role in carriers for robot in found[role]}
            theirs = [each for each in free if each.name in robots]
            wanted = {name: _config_of(need) for name, need in inner.roles.items()}
            found |= filled(wanted, needs, theirs, inner.require, request.robots)
        if not rehearses:
            self._require_rehearsal(mission, program, request, found)
        return found

    def _require_rehearsal(
        self,
        mission: Mission,
        program: Program,
        request: MissionStartRequest,
        roles: dict[str, list[str]] | None,
    ) -> None:
        """Raise Refused if a required rehearsal is missing; ``roles``: None if not known yet."""
        if mission.config.rehearse != "required":
            return
        places = {each.name: each.facts.position for each in self._candidates()}
        why = self.rehearsed(program, roles, places)
        if why:
            raise Refused(
                f"it must be rehearsed first, and {why}", hint=rehearse_command(mission.name, request)
            )

    def conflicting_runs(self, mission: Mission, program: Program, request: MissionStartRequest) -> list[str]:
        """Return the conflicting runs: of the same mission, at its places, or with robots that it needs.

        Raises Refused if the mission could not start even after their end.
        """
        self._require_rehearsal(mission, program, request, None)
        needs, free = needs_of(program), self._free(request.run)
        found = conflicting_runs(mission.config.roles, needs, free, program.require, request.robots)
        for run in self._runs():
            places = set(program.occupies) & set(run.engine.program.occupies)
            if any(map(self._is_full, places)) or run.about.mission == program.mission:
                found.add(run.id)
        return sorted(found - {request.run})

    def left_out(self, mission: Mission, roles: Mapping[str, Iterable[str]]) -> set[str]:
        """Return the robots that match a mission's roles but fill none of them."""
        taken = {robot for robots in roles.values() for robot in robots}
        requested = mission.config.roles.values()
        meant = {
            each.name for each in self._candidates() if any(matches_role(each, role) for role in requested)
        }
        return meant - taken

    def _free(self, run: str) -> list[RoleCandidate]:
        """Return all robots as candidates; robots that have joined ``run`` already count as free.

        After a restart, robots belong to the resumed runs before their own states say so. The state of a
        robot in a worker is late: it may still name a run that has ended. Such a robot has been told to
        leave, and refuses to join another run if it has not.
        """
        has = {member.robot: each.id for each in self._runs() for member in each.engine.robots.ours()}
        found = []
        for each in self._candidates():
            now = has.get(each.name, "" if each.run in self._ended else each.run)
            found.append(msgspec.structs.replace(each, run="" if now == run else now))
        return found


def rehearse_command(name: str, request: MissionStartRequest) -> str:
    """Return the command line that rehearses a mission as requested."""
    words = ["fleet mission rehearse", name if request.mission is None else "FILE"]
    words += [f"{key}={value}" for key, value in request.inputs.items()]
    words += [f"--robot {role}={robot}" for role, robots in request.robots.items() for robot in robots]
    return " ".join(words)


def roles_of(role: str, roles: Iterable[str]) -> list[str]:
    """Return the roles that a name stands for: itself, or with ``all`` those of its mission."""
    scope, _, name = role.rpartition(".")
    return (
        [role]
        if name != ALL
        else [each for each in roles if each.rpartition(".")[0] == scope and " " not in each]
    )


def members_of(program: Program, roles: Mapping[str, Iterable[str]]) -> list[RunMember]:
    """Return the members of a run; ``roles`` are those of its mission and its inner missions."""
    plays: dict[str, dict[str, int]] = {}
    for inner, mission in program.inner.items():
        for role in mission.roles:
            for at, robot in enumerate(roles[role]):
                plays.setdefault(robot, {}).update({role: at, f"{inner}.{ALL}": at})
    members = [
        RunMember(robot, role, at, plays.get(robot, {}))
        for role in program.quorum
        for at, robot in enumerate(roles[role])
    ]
    waiting = [
        RunMember(robot, role, 0, ours=False, within=False, spare=True)
        for role in program.quorum
        for robot in roles.get(spare_of(role), ())
    ]
    return members + waiting


def _config_of(need: RoleNeed) -> RoleConfig:
    """Return the role of an inner mission as a config."""
    count = CountConfig(min=need.least, max=need.most)
    return RoleConfig.model_validate(
        {"from": need.source, "kind": need.kind, "can": need.can, "count": count}
    )


def needs_of(program: Program) -> dict[str, frozenset[str]]:
    """Return the needs of each role in the steps: commands by name, goto, path and plan.

    A role that executes an inner mission with one role has the needs of that role as well. With several inner
    roles, the robots are checked when those roles are filled from them.
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
    """Return the capabilities that a robot needs for an act."""
    if act.verb == "plan":
        return plan_needs(act.value)
    return {str(act.value) if act.verb == "command" else act.verb}


def mission_state(mission: Mission, edge: str) -> MissionState:
    """Return the description of a mission for users."""
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
    """Describe an input."""
    words = f"{kind} {unit}".strip()
    return words if default is None else f"{words}, {default} when left out"
