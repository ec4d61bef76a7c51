"""Limits of runs with robots of other edges, checked before anything moves; pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from fleet.errors import Refused
from fleet.missions.program import Condition, Loop, Program, WaitFor
from fleet.missions.run_robots import RunRobots
from fleet.model.state import RobotState

EdgeOf = Callable[[str], str]
"""Returns the other edge that has a robot; empty for a robot of this edge."""


def require_reach(program: Program, robots: RunRobots, edge: str, edge_of: EdgeOf) -> None:
    """Raise Refused for places and events that cannot work with robots of other edges."""
    others = {name: there for name in robots.members if (there := edge_of(name))}
    if others and program.occupies:
        name, there = min(others.items())
        raise Refused(
            f"{', '.join(program.occupies)}: a place cannot be occupied on two edges, and {name} of {there} "
            f"takes part",
            hint=f"leave out occupies, or the robots of {there}",
        )
    for step, condition in _conditions(program):
        names = (each.robot for each in robots.members.values() if _is_meant(robots, each.robot, condition))
        unheard = next((name for name in names if name in others), "")
        if condition.event and unheard:
            raise Refused(
                f"step {step}: {edge} receives no events of {unheard}, a robot of {others[unheard]}",
                hint="wait for its battery or health, or for an event of a robot of this edge",
            )


def not_kept_apart(states: Iterable[RobotState], edge_of: EdgeOf) -> str:
    """Describe the robots in a run of several edges whose separation from others is unknown."""
    states = tuple(states)
    if len({edge_of(state.name) for state in states}) < 2:
        return ""
    hidden = [f"{state.name}: separation {state.separation}" for state in states if state.separation]
    return f"Not kept apart from each other: {'; '.join(hidden)}" if hidden else ""


def _conditions(program: Program) -> Iterator[tuple[str, Condition]]:
    """Yield the conditions of a program with their step ids."""
    for step in program.steps:
        found = [step.only_if]
        found += [step.condition] if isinstance(step, WaitFor) else []
        found += [step.until] if isinstance(step, Loop) else []
        yield from ((step.id, each) for each in found if each is not None)


def _is_meant(robots: RunRobots, robot: str, condition: Condition) -> bool:
    """Return True if a condition applies to a robot."""
    return condition.role == "all" or robots.plays(robot, condition.role)
