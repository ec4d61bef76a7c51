"""Checks of inner missions: the names, inputs and settings of steps with ``mission:``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from fleet.config.problems import YamlPath
from fleet.config.text import nearest
from fleet.missions.model import ALL, ActConfig, MissionConfig, StepConfig

ReportProblem = Callable[[YamlPath, str, str], None]
"""Reports an error at a path, with a hint."""
_ONE_END = ("on_failure", "on_abort", "on_restart")
"""Settings of a whole run, which has one end: those of the outermost mission apply."""


def inner_mission_steps(mission: MissionConfig, at: YamlPath) -> Iterator[tuple[str, ActConfig, YamlPath]]:
    """Yield role, act and path of each step that executes another mission."""
    for step, where in all_steps(mission.steps, (*at, "steps")):
        if step.mission is not None:
            role, act = step.mission
            yield role, act, (*where, "do", role)


def all_steps(steps: list[StepConfig], at: YamlPath) -> Iterator[tuple[StepConfig, YamlPath]]:
    """Yield all steps with their paths, including repeated ones."""
    for index, step in enumerate(steps):
        yield step, (*at, index)
        if step.repeat is not None:
            yield from all_steps(step.repeat.steps, (*at, index, "repeat", "steps"))


class InnerCheck:
    """Checks the inner missions of one mission. ``known``: all valid missions, by name.

    ``named``: all declared missions, including invalid ones; None if unknown. ``report`` receives each error.
    """

    def __init__(
        self,
        name: str,
        config: MissionConfig,
        known: Mapping[str, MissionConfig],
        named: set[str] | None,
        report: ReportProblem,
    ) -> None:
        self._name = name
        self._config = config
        self._known = {**known, name: config}
        self._named = named
        self._report = report

    def all(self, at: YamlPath, given: Callable[[YamlPath], Any]) -> None:
        """Check each step that executes a mission; ``given`` returns its inputs as written."""
        for role, act, where in inner_mission_steps(self._config, at):
            name, place = act.mission or "", (*where, "mission")
            cycle = self._cycle_from(name, (self._name,))
            inner = self._known.get(name)
            if cycle:
                self._report(
                    place, f"a mission within itself: {' > '.join(cycle)}", "take it out of one of them"
                )
            elif inner is not None:
                self._inputs(act, inner, where, given((*where, "with")))
                self._robots(role, name, inner, place)
                self._end(name, inner, place)
            elif self._named is not None and name not in self._named:
                hint = nearest(name, self._named) or "missions are declared under missions: in fleet.yaml"
                self._report(place, f"there is no mission {name!r}", hint)

    def _cycle_from(self, name: str, before: tuple[str, ...]) -> tuple[str, ...]:
        """Return the cycle from a mission back to this one; empty if there is none."""
        if name == self._name:
            return (*before, name)
        found = self._known.get(name)
        if found is None or name in before:
            return ()
        cycles = (
            self._cycle_from(act.mission or "", (*before, name))
            for _, act, _ in inner_mission_steps(found, ())
        )
        return next((cycle for cycle in cycles if cycle), ())

    def _inputs(self, act: ActConfig, inner: MissionConfig, where: YamlPath, given: Any) -> None:
        """Check the inputs of an inner mission; a value that is itself an input is checked at the start."""
        written = given if isinstance(given, dict) else {}
        for key in act.with_:
            place = (*where, "with", key)
            declared = inner.inputs.get(key)
            if declared is None:
                hint = nearest(key, inner.inputs) or f"it takes {', '.join(inner.inputs) or 'none'}"
                self._report(place, f"{act.mission} has no input {key!r}", hint)
            elif not isinstance(written.get(key), dict) and (trouble := declared.trouble(act.with_[key])):
                self._report(place, trouble, "")
        missing = [key for key, each in inner.inputs.items() if each.default is None and key not in act.with_]
        if missing:
            place = (*where, "mission")
            self._report(place, f"{act.mission} needs {', '.join(missing)}", "give them under with:")

    def _robots(self, role: str, name: str, inner: MissionConfig, place: YamlPath) -> None:
        """Check that the role can have as many robots as the roles of the inner mission need."""
        roles = self._config.roles
        names = roles if role == ALL else [role] if role in roles else []
        most = sum(roles[each].count.max for each in names)
        least = sum(each.count.min for each in inner.roles.values())
        if names and least > most:
            self._report(place, f"{name} needs {least} robots, {role} has at most {most}", "")

    def _end(self, name: str, inner: MissionConfig, place: YamlPath) -> None:
        """Check that its settings for the end of the run agree with the outer mission's."""
        for key in _ONE_END:
            said, ours = getattr(inner, key), getattr(self._config, key)
            if key in inner.model_fields_set and said != ours:
                message = f"{name} says {key}: {said}, {self._name} {key}: {ours}, and a run has one end"
                self._report(place, message, f"say the same in both, or leave {key} out in {name}")
        if inner.rehearse is not None and self._config.rehearse is None:
            self._report(place, f"{name} must be rehearsed", f"say rehearse: required in {self._name} too")
