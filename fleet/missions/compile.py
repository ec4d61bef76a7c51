"""From a checked mission to the program that the engine runs."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.missions.model import ActConfig, BatteryConfig, ConditionConfig, MissionConfig, StepConfig
from fleet.missions.program import (
    Act,
    Again,
    Ask,
    Condition,
    Do,
    Instruction,
    Loop,
    Program,
    Require,
    Wait,
    WaitFor,
)


def compiled(name: str, mission: MissionConfig) -> Program:
    """Return the program of a mission whose inputs are filled in and whose files are read."""
    steps: list[Instruction] = []
    _add(mission.steps, steps)
    require = mission.require
    return Program(
        mission=name,
        steps=tuple(steps),
        quorum={role: mission.quorum.get(role, each.count.min) for role, each in mission.roles.items()},
        require=Require(require.health, require.battery.min, require.battery.max),
        occupies=tuple(sorted(mission.occupies)),
        deadline=mission.deadline,
        on_failure=mission.on_failure,
        on_abort=mission.on_abort,
        on_restart=mission.on_restart,
    )


def _add(steps: Sequence[StepConfig], to: list[Instruction]) -> None:
    """Append the instructions of steps."""
    for step in steps:
        if step.repeat is None:
            to.append(_instruction(step))
            continue
        begin = len(to)
        to.append(Loop(step.id, step.repeat.times, 0))  # its end is known below
        _add(step.repeat.steps, to)
        to.append(Again(begin))
        until = step.repeat.until
        to[begin] = Loop(
            step.id,
            step.repeat.times,
            len(to),
            _condition(until) if until is not None else None,
            _only_if(step),
        )


def _instruction(step: StepConfig) -> Instruction:
    """Return the instruction of a step that repeats nothing."""
    only_if = _only_if(step)
    if step.wait is not None:
        return Wait(step.id, step.wait, only_if)
    if step.wait_for is not None:
        fails = step.wait_for.on_timeout == "fail"
        return WaitFor(step.id, _condition(step.wait_for), step.wait_for.timeout, fails, only_if)
    if step.ask is not None:
        return Ask(step.id, step.ask.text, step.ask.timeout, step.ask.on_timeout, only_if)
    assert step.do is not None
    return Do(
        step.id,
        {role: _acts(act, step.timeout) for role, act in step.do.items()},
        only_if,
        step.finish,
        step.start == "together",
        step.robot_failed.do,
        step.robot_failed.then,
        {role: _acts(act, step.timeout) for role, act in step.undo.items()},
    )


def _only_if(step: StepConfig) -> Condition | None:
    """Return the condition of a step."""
    return _condition(step.if_) if step.if_ is not None else None


def _condition(given: ConditionConfig) -> Condition:
    """Return a condition."""
    battery = given.battery or BatteryConfig()
    return Condition(
        given.role, given.of == "all", battery.min, battery.max, given.health or "", given.event or ""
    )


def _acts(given: ActConfig, timeout: float) -> tuple[Act, ...]:
    """Return one act for all robots of the role, or one for each, where a list of files says so."""
    verb = given.verb
    value = getattr(given, verb)
    each = value if is_for_each(verb, value) else [value]
    return tuple(
        Act(verb, one, given.with_, given.speed, given.timeout or timeout, given.retry) for one in each
    )


def is_for_each(verb: str, value: object) -> bool:
    """Return whether a list has something for each robot of a role, and is no path itself.

    A file's content, once read, is a list of points (path) or a mapping (plan).
    """
    if not isinstance(value, list):
        return False
    if verb == "plan":
        return True
    return verb == "path" and not all(_is_point(each) for each in value)


def _is_point(value: object) -> bool:
    """Return whether a value is one point of a path: two or three numbers."""
    return isinstance(value, list) and all(isinstance(each, int | float) for each in value)
