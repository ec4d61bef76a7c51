"""Compiler from a validated mission to the program that the engine runs.

Inner missions become part of the same flat list, between an ``Enter`` and a ``Leave``. So pause, abort,
stops, restarts and undo apply to them as to any step, and one record holds the whole position of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec

from fleet.errors import Refused
from fleet.missions.model import (
    ALL,
    FOLLOW_AT,
    ActConfig,
    BatteryConfig,
    ConditionConfig,
    MissionConfig,
    RoleConfig,
    StepConfig,
)
from fleet.missions.points import is_point
from fleet.missions.program import (
    Act,
    Again,
    Ask,
    Condition,
    Do,
    Enter,
    Inner,
    Instruction,
    Leave,
    Loop,
    Program,
    Require,
    RoleNeed,
    Wait,
    WaitFor,
)
from fleet.yaml_model import LONGEST

DEEPEST = 5  # levels of inner missions
MOST = 10_000  # instructions of a program
InnerMission = Callable[[str, Mapping[str, Any]], MissionConfig]
"""Returns another mission with its inputs filled in; raises Refused."""


def compiled(name: str, mission: MissionConfig, inner: InnerMission) -> Program:
    """Return the program of a mission whose inputs are filled in and whose files are read.

    Raises Refused for invalid inner missions.
    """
    compiler = _Compiler(inner)
    require = _require_of(mission)
    compiler.add(mission, _Scope((name,), "", require))
    return Program(
        mission=name,
        steps=tuple(compiler.steps),
        quorum=_quorum_of(mission),
        require=require,
        occupies=tuple(sorted(compiler.occupies)),
        occupy_within=mission.occupy_within,
        deadline=mission.deadline,
        on_failure=mission.on_failure,
        on_abort=mission.on_abort,
        on_restart=mission.on_restart,
        inner=compiler.inner,
    )


class _Scope(msgspec.Struct, frozen=True):
    """The mission being compiled, with its outer missions and the prefix of its names."""

    missions: tuple[str, ...]
    prefix: str
    require: Require

    def condition(self, given: ConditionConfig | None) -> Condition | None:
        """Compile a condition with the full name of its role."""
        if given is None:
            return None
        battery = given.battery or BatteryConfig()
        role, every = self.prefix + given.role, given.of == "all"
        return Condition(role, every, battery.min, battery.max, given.health or "", given.event or "")

    def acts(self, given: Mapping[str, ActConfig], timeout: float) -> dict[str, tuple[Act, ...]]:
        """Compile the acts of the roles of a step."""
        return {
            self.prefix + role: (self._following(act),) if act.follow else _acts(act, timeout)
            for role, act in given.items()
        }

    def _following(self, act: ActConfig) -> Act:
        """Compile a ``follow`` act; the end of its step ends it, so it has no real timeout."""
        data = {"distance_m": act.distance or FOLLOW_AT}
        return Act("follow", f"{self.prefix}{act.follow}", data, act.speed, LONGEST)


class _Compiler:
    """Appends the instructions of a mission and of its inner missions."""

    def __init__(self, inner_mission: InnerMission) -> None:
        self.steps: list[Instruction] = []
        self.inner: dict[str, Inner] = {}
        self.occupies: set[str] = set()
        self._inner_mission = inner_mission

    def add(self, mission: MissionConfig, scope: _Scope) -> None:
        """Append a mission."""
        self.occupies |= set(mission.occupies)
        self._add(mission.steps, scope)

    def _add(self, steps: Sequence[StepConfig], scope: _Scope) -> None:
        """Append the instructions of steps."""
        for step in steps:
            if len(self.steps) > MOST:
                raise Refused(f"the mission comes to more than {MOST} steps")
            if step.repeat is not None:
                self._add_repeat(step, scope)
            elif step.mission is not None:
                self._add_mission(step, *step.mission, scope)
            else:
                self.steps.append(_instruction(step, scope))

    def _add_repeat(self, step: StepConfig, scope: _Scope) -> None:
        """Append a repeat: its start, its steps and the jump back."""
        repeat, begin = step.repeat, len(self.steps)
        assert repeat is not None
        name, until = scope.prefix + step.id, scope.condition(repeat.until)
        self.steps.append(Loop(name, repeat.times, 0))  # placeholder; its end is known below
        self._add(repeat.steps, scope)
        self.steps.append(Again(begin))
        only_if = scope.condition(step.if_)
        self.steps[begin] = Loop(name, repeat.times, len(self.steps), until, only_if)

    def _add_mission(self, step: StepConfig, role: str, act: ActConfig, scope: _Scope) -> None:
        """Append an inner mission, executed by a role."""
        name, begin = act.mission or "", len(self.steps)
        if name in scope.missions:
            raise Refused(f"a mission within itself: {' > '.join((*scope.missions, name))}")
        if len(scope.missions) > DEEPEST:
            raise Refused(f"more than {DEEPEST} missions stand within each other")
        try:
            mission = self._inner_mission(name, act.with_)
        except Refused as error:
            raise Refused(f"step {step.id}: {error.reason}", hint=error.hint) from None
        where = scope.prefix + step.id
        require = scope.require.with_(_require_of(mission))
        inside = _Scope((*scope.missions, name), f"{where}.", require)
        roles = {inside.prefix + each: _need(found) for each, found in mission.roles.items()}
        self.inner[where] = Inner(scope.prefix + role, roles, require)
        leave = Leave(begin, where)
        self.steps.append(leave)  # placeholder for its Enter, whose end is known below
        self.add(mission, inside)
        self.steps.append(leave)
        self.steps[begin] = Enter(
            where,
            name,
            inside.prefix + ALL,
            len(self.steps),
            {inside.prefix + each: least for each, least in _quorum_of(mission).items()},
            mission.deadline,
            step.robot_failed.do,
            step.robot_failed.then,
            scope.condition(step.if_),
        )


def _require_of(mission: MissionConfig) -> Require:
    """Return the requirements of a mission."""
    return Require(mission.require.health, mission.require.battery.min, mission.require.battery.max)


def _quorum_of(mission: MissionConfig) -> dict[str, int]:
    """Return the number of robots that each role must keep."""
    return {role: mission.quorum.get(role, each.count.min) for role, each in mission.roles.items()}


def _need(role: RoleConfig) -> RoleNeed:
    """Return the requirements of a role."""
    return RoleNeed(role.count.min, role.count.max, role.from_, role.kind, role.can)


def _instruction(step: StepConfig, scope: _Scope) -> Instruction:
    """Compile a step that is no repeat and no inner mission."""
    name, only_if = scope.prefix + step.id, scope.condition(step.if_)
    if step.wait is not None:
        return Wait(name, step.wait, only_if)
    awaited = scope.condition(step.wait_for)
    if step.wait_for is not None and awaited is not None:
        return WaitFor(name, awaited, step.wait_for.timeout, step.wait_for.on_timeout == "fail", only_if)
    if step.ask is not None:
        return Ask(name, step.ask.text, step.ask.timeout, step.ask.on_timeout, only_if)
    assert step.do is not None
    return Do(
        name,
        scope.acts(step.do, step.timeout),
        only_if,
        step.finish if step.finish in {"all", "any"} else scope.prefix + step.finish,
        step.start == "together",
        step.robot_failed.do,
        step.robot_failed.then,
        scope.acts(step.undo, step.timeout),
        scope.require if scope.prefix else None,
    )


def _acts(given: ActConfig, timeout: float) -> tuple[Act, ...]:
    """Return one act for all robots of the role, or one per robot for a list of files."""
    verb = given.verb
    value = getattr(given, verb)
    each = value if is_for_each(verb, value) else [value]
    return tuple(
        Act(verb, one, given.with_, given.speed, given.timeout or timeout, given.retry) for one in each
    )


def is_for_each(verb: str, value: object) -> bool:
    """Return True if a value lists one item per robot of a role, and is no path itself.

    The content of a file, once read, is a list of points (path) or a mapping (plan).
    """
    if not isinstance(value, list):
        return False
    if verb == "plan":
        return True
    return verb == "path" and not all(is_point(each) for each in value)
