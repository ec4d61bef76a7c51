"""Checks of steps in which robots follow others: leader and end of the step; pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec

from fleet.config.problems import YamlPath
from fleet.missions.model import ALL, ActConfig, MissionConfig, StepConfig


class FollowProblem(msgspec.Struct, frozen=True):
    """An error, its path within the step, and a hint."""

    path: YamlPath
    message: str
    hint: str


def follow_problems(step: StepConfig, mission: MissionConfig) -> Iterator[FollowProblem]:
    """Yield the errors of ``follow`` in a step."""
    acts = step.do or {}
    for role, act in step.undo.items():
        if act.follow is not None:
            yield FollowProblem(("undo", role, "follow"), "to follow undoes nothing", "say where it goes")
    for role, act in acts.items():
        trouble = (act.follow and _trouble(act.follow, mission)) or _chain_problem(role, acts)
        if act.follow is not None and trouble:
            hint = "one robot is followed, which does something else in the same step"
            yield FollowProblem(("do", role, "follow"), trouble, hint)
    ends = acts.get(step.finish) if step.finish != ALL else None
    if ends is not None and ends.follow is not None:
        hint = "all, any, or a role that does something else"
        yield FollowProblem(("finish",), f"{step.finish} follows, and is never through by itself", hint)


def _trouble(leader: str, mission: MissionConfig) -> str:
    """Return why a role cannot be followed; empty if it can."""
    if leader == ALL:
        return "all is every robot"
    if leader not in mission.roles:
        return f"there is no role {leader!r}"
    most = mission.roles[leader].count.max
    return f"role {leader} may have {most} robots" if most > 1 else ""


def _chain_problem(role: str, acts: Mapping[str, ActConfig]) -> str:
    """Return why a chain of followers has no leader; empty if it has one."""
    before: list[str] = []
    act = acts.get(role)
    while act is not None and act.follow is not None:
        if role in before:
            return f"no robot leads: {' > '.join([*before, role])}"
        before.append(role)
        role = act.follow
        act = acts.get(role, acts.get(ALL))
    return "" if act is not None else f"{role} does nothing in this step"
