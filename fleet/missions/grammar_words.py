"""Descriptions of a mission as sentences for readers who do not know the grammar."""

from __future__ import annotations

from fleet.missions.model import ActConfig, ConditionConfig, RoleConfig, StepConfig


def role_words(role: RoleConfig) -> str:
    """Describe the robots of a role."""
    least, most = role.count.min, role.count.max
    count = f"{least}" if least == most else f"at least {least}" if most >= 1000 else f"{least} to {most}"
    words = [f"{count} robot{'' if 1 in (most, least if most >= 1000 else most) else 's'}"]
    words += [f"of the kind {role.kind}"] if role.kind else []
    words += [f"from {role.from_}"] if role.from_ else []
    words += [f"with the command{'s' if len(role.can) > 1 else ''} {', '.join(role.can)}"] if role.can else []
    words += [f"and {role.spares} spare"] if role.spares else []
    return " ".join(words)


def step_words(step: StepConfig) -> str:
    """Describe a step."""
    condition = f" if {_condition(step.if_)}" if step.if_ is not None else ""
    return f"{step.id}: {_action_words(step)}{condition}"


def _action_words(step: StepConfig) -> str:
    """Describe a step without its name and condition."""
    if step.wait is not None:
        return f"wait {step.wait:g} s"
    if step.wait_for is not None:
        return f"wait until {_condition(step.wait_for)}, {step.wait_for.timeout:g} s at the most"
    if step.ask is not None:
        return f"ask a person: {step.ask.text}"
    if step.repeat is not None:
        until = f" or until {_condition(step.repeat.until)}" if step.repeat.until is not None else ""
        inner = "; ".join(step_words(each) for each in step.repeat.steps)
        return f"{step.repeat.times} times{until}: {inner}"
    together = "together, " if step.start else ""
    return together + ", ".join(f"{role} {_act(act)}" for role, act in (step.do or {}).items())


def _act(act: ActConfig) -> str:
    """Describe the act of a role."""
    if act.command is not None:
        return f"does {act.command}"
    if act.goto is not None:
        point = act.goto if isinstance(act.goto, str | dict) else [round(each, 2) for each in act.goto]
        return f"goes to {point}"
    if act.mission is not None:
        return f"carries out the mission {act.mission}"
    if act.follow is not None:
        return f"follows {act.follow}"
    return "follows a path" if act.path is not None else "flies a plan"


def _condition(condition: ConditionConfig) -> str:
    """Describe a condition."""
    of = f"{condition.of} of {condition.role}"
    if condition.event is not None:
        return f"{of} reports {condition.event}"
    if condition.health is not None:
        return f"{of} is {condition.health}"
    battery = condition.battery
    assert battery is not None
    bounds = [f"at least {battery.min:g} %"] if battery.min is not None else []
    bounds += [f"at most {battery.max:g} %"] if battery.max is not None else []
    return f"the battery of {of} is {' and '.join(bounds) or 'anything'}"
