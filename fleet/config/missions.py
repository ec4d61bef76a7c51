"""Validation of missions in fleet.yaml and in files; every error has file, line and column.

The models define the structure. Checks across parts (unknown roles, repeated step names, missing plan files)
are here.
"""

from __future__ import annotations

import json
import pathlib
from collections.abc import Collection, Iterable, Mapping
from functools import partial
from typing import Any

import msgspec

from fleet.config.explain import validated
from fleet.config.inner_missions import InnerCheck
from fleet.config.mission_files import with_files
from fleet.config.mission_follow import follow_problems
from fleet.config.problems import InvalidConfig, YamlPath
from fleet.config.text import nearest
from fleet.config.yaml import Document, read
from fleet.errors import Refused, WireError
from fleet.missions.compile import compiled, is_for_each
from fleet.missions.model import (
    ALL,
    DEEPEST,
    NEVER_REPEATED,
    ActConfig,
    ConditionConfig,
    InputConfig,
    MissionConfig,
    StepConfig,
)
from fleet.missions.plan import items_of, made_for
from fleet.missions.program import Program
from fleet.missions.short_forms import normalised
from fleet.model.event import EventKind
from fleet.wire.missions import plan_of


class Mission(msgspec.Struct, frozen=True):
    """A valid mission.

    ``data`` is its content, including that of its files; ``config`` has sample values for inputs. ``others``
    are the possible inner missions, by name.
    """

    name: str
    data: dict[str, Any]
    config: MissionConfig
    others: Mapping[str, Mission] = {}

    def program(self, given: Mapping[str, Any]) -> Program:
        """Return the program for given inputs; raises Refused with the error in them."""
        return compiled(self.name, self.filled(given), self._inner)

    def _inner(self, name: str, given: Mapping[str, Any]) -> MissionConfig:
        """Return an inner mission for given inputs; raises Refused."""
        if name not in self.others:
            raise Refused(
                f"there is no mission {name!r}", hint=f"known are {', '.join(self.others) or 'none'}"
            )
        try:
            return self.others[name].filled(given)
        except Refused as error:
            raise Refused(f"mission {name}: {error.reason}", hint=error.hint) from None

    def filled(self, given: Mapping[str, Any]) -> MissionConfig:
        """Return the mission with its inputs replaced by values; raises Refused."""
        values = _values(self.config.inputs, given)
        filled = normalised(self.data, values)
        try:
            return MissionConfig.model_validate_json(json.dumps(filled), strict=True)
        except ValueError as error:
            first = str(error).splitlines()
            raise Refused(f"{self.name}: {' '.join(first[1:3])}") from None


class KnownNames(msgspec.Struct, frozen=True):
    """Names that a mission may use: robots and groups, places, missions. None if the fleet is unknown."""

    names: Collection[str] | None = None
    places: Collection[str] | None = None
    missions: Mapping[str, Mission] | None = None
    on_earth: bool | None = None  # whether the site has an origin
    events: Collection[str] | None = None


def events_of(declared: Iterable[str]) -> list[str]:
    """Return the events that a mission may wait for: the host's own, and those declared in fleet.yaml."""
    return [*(kind.value for kind in EventKind), *map(str, declared)]


def read_mission(path: pathlib.Path, environ: Mapping[str, str], known: KnownNames) -> Mission:
    """Return the mission of a file; raises InvalidConfig with every error."""
    document = read(path, environ)
    return _alone(checked_mission(path.stem, (), document, path.parent, known), document, known)


def mission_of(
    name: str,
    data: Any,
    missions: Mapping[str, Mission] | None = None,
    events: Collection[str] | None = None,
) -> Mission:
    """Return a mission received over the bus, with the contents of its files; raises InvalidConfig.

    ``missions`` are the possible inner missions, ``events`` those that it may wait for.
    """
    document = read_data(data)
    known = KnownNames(missions=missions, events=events)
    return _alone(checked_mission(name, (), document, None, known), document, known)


def _alone(mission: Mission | None, document: Document, known: KnownNames) -> Mission:
    """Return a mission in a document of its own; raises InvalidConfig."""
    if mission is not None:
        others = known.missions or {}
        named = None if known.missions is None else set(others)
        _check_inner(mission, (), document, others, named)
    if mission is None or document.problems:
        raise InvalidConfig(document.problems)
    return msgspec.structs.replace(mission, others=known.missions or {})


def read_data(data: Any) -> Document:
    """Return a document for data without a file: every position is its start."""
    from fleet.config.problems import Mark  # noqa: PLC0415

    document = Document(data=data)

    def note(value: Any, at: YamlPath) -> None:
        document.marks[at] = document.keys[at] = Mark("mission", 1, 1, at)
        parts = (
            value.items() if isinstance(value, dict) else enumerate(value if isinstance(value, list) else ())
        )
        for step, part in parts:
            note(part, (*at, step))

    note(data, ())
    return document


def check_missions(
    data: Mapping[str, Any], document: Document, folder: pathlib.Path, known: KnownNames
) -> list[Mission]:
    """Return the valid missions of a fleet file; the errors of all are reported."""
    listed = data.get("missions")
    found: dict[str, Mission] = {}
    named = {name: mission for name, mission in listed.items() if mission} if isinstance(listed, dict) else {}
    for name in named:
        at = ("missions", name)
        base = pathlib.Path(document.marks[at].file).parent if at in document.marks else folder
        checked = checked_mission(name, at, document, base, known)
        if checked is not None:
            found[name] = msgspec.structs.replace(checked, others=found)
    for name, mission in found.items():
        _check_inner(mission, ("missions", name), document, found, set(named))
    return list(found.values())


def _check_inner(
    mission: Mission, at: YamlPath, document: Document, others: Mapping[str, Mission], named: set[str] | None
) -> None:
    """Report the errors of a mission's inner missions."""

    def report(path: YamlPath, message: str, hint: str) -> None:
        _report_at(document, path, message, hint)

    known = {name: each.config for name, each in others.items()}
    InnerCheck(mission.name, mission.config, known, named, report).all(at, partial(at_path, document.data))


def at_path(value: Any, path: YamlPath) -> Any:
    """Return the value at a path; None for a missing one."""
    for step in path:
        value = value.get(step) if isinstance(value, dict) else value[step]
    return value


def _report_at(document: Document, path: YamlPath, message: str, hint: str = "") -> None:
    """Report an error at the nearest position in the file."""
    while path and path not in document.marks:
        path = path[:-1]
    document.report(document.marks[path], message, hint)


def checked_mission(
    name: str, at: YamlPath, document: Document, folder: pathlib.Path | None, known: KnownNames
) -> Mission | None:
    """Validate the mission at a path; None after reporting the errors.

    ``folder`` is the base of its file names; None: it has no files.
    """
    data = document.data
    for step in at:
        data = data[step]
    samples = _samples(data)
    config = validated(MissionConfig, normalised(data, samples), at, document, {"folder": folder})
    if config is None:
        return None
    check = _MissionCheck(config, at, document, known, has_files=folder is not None)
    check.inputs(data, at)
    check.all()
    if folder is not None:
        data = with_files(data, at, document, folder)
    return Mission(name, data, config)


class _MissionCheck:
    """Checks across the parts of one mission."""

    def __init__(
        self, mission: MissionConfig, at: YamlPath, document: Document, known: KnownNames, *, has_files: bool
    ) -> None:
        self._mission = mission
        self._at = at
        self._document = document
        self._known = known
        self._has_files = has_files
        self._ids: set[str] = set()

    def report(self, path: YamlPath, message: str, hint: str = "") -> None:
        """Report an error at the nearest position in the file."""
        _report_at(self._document, path, message, hint)

    def inputs(self, value: Any, at: YamlPath) -> None:
        """Report undeclared inputs."""
        if isinstance(value, dict):
            if set(value) == {"input"} and value["input"] not in self._mission.inputs:
                hint = nearest(str(value["input"]), self._mission.inputs) or "declare it under inputs:"
                self.report(at, f"there is no input {value['input']!r}", hint)
            for key, each in value.items():
                self.inputs(each, (*at, key))
        elif isinstance(value, list):
            for index, each in enumerate(value):
                self.inputs(each, (*at, index))

    def all(self) -> None:
        """Check roles, quorum, places and every step."""
        mission = self._mission
        for name, role in mission.roles.items():
            where = (*self._at, "roles", name)
            if name == ALL:
                self.report(where, "all is every role together", "give the role another name")
            if self._known.names is not None and role.from_ and role.from_ not in self._known.names:
                hint = nearest(role.from_, self._known.names) or f"known are {', '.join(self._known.names)}"
                self.report((*where, "from"), f"there is no robot or group {role.from_!r}", hint)
        for name, least in mission.quorum.items():
            where = (*self._at, "quorum", name)
            if name not in mission.roles:
                self._no_role(where, name)
            elif not 0 <= least <= mission.roles[name].count.max:
                self.report(
                    where, f"must be 0 to {mission.roles[name].count.max}, the most that fill the role"
                )
        for index, place in enumerate(mission.occupies):
            self._place(place, (*self._at, "occupies", index))
        self._not_a_repeated(mission.on_abort, (*self._at, "on_abort"))
        self._steps(mission.steps, (*self._at, "steps"), 0)

    def _no_role(self, where: YamlPath, name: str) -> None:
        """Report an undeclared role."""
        hint = (
            nearest(name, [*self._mission.roles, ALL]) or f"roles are {', '.join(self._mission.roles)}, all"
        )
        self.report(where, f"there is no role {name!r}", hint)

    def _place(self, name: str, where: YamlPath) -> None:
        """Report a place that is not in fleet.yaml."""
        if self._known.places is not None and name not in self._known.places:
            hint = nearest(name, self._known.places) or "places are declared under places: in fleet.yaml"
            self.report(where, f"there is no place {name!r}", hint)

    def _not_a_repeated(self, command: str, where: YamlPath) -> None:
        """Report a command that starts something where the mission must become safer."""
        if command in NEVER_REPEATED:
            self.report(where, f"{command} makes nothing safer", "hold, land or return_to_home")

    def _steps(self, steps: list[StepConfig], at: YamlPath, depth: int) -> None:
        """Check steps, including repeated ones."""
        if depth > DEEPEST:
            self.report(at, f"repeats stand within each other more than {DEEPEST} deep")
            return
        for index, step in enumerate(steps):
            where = (*at, index)
            if step.id in self._ids:
                self.report((*where, "id"), f"there is another step {step.id!r}", "give it a name of its own")
            self._ids.add(step.id)
            self._step(step, where)
            if step.repeat is not None:
                self._condition(step.repeat.until, (*where, "repeat", "until"))
                self._steps(step.repeat.steps, (*where, "repeat", "steps"), depth + 1)

    def _step(self, step: StepConfig, where: YamlPath) -> None:
        """Check one step."""
        self._condition(step.if_, (*where, "if"))
        self._condition(step.wait_for, (*where, "wait_for"))
        for key, acts in (("do", step.do or {}), ("undo", step.undo)):
            for role, act in acts.items():
                self._role(role, (*where, key, role))
                self._act(act, role, (*where, key, role))
        if step.do is not None and step.finish not in {"all", "any", *step.do}:
            self._no_role((*where, "finish"), step.finish)
        for problem in follow_problems(step, self._mission):
            self.report((*where, *problem.path), problem.message, problem.hint)
        self._not_a_repeated(step.robot_failed.do, (*where, "robot_failed", "do"))

    def _role(self, name: str, where: YamlPath) -> None:
        """Check that a role is declared."""
        if name != ALL and name not in self._mission.roles:
            self._no_role(where, name)

    def _condition(self, condition: ConditionConfig | None, where: YamlPath) -> None:
        """Check the role and the event of a condition."""
        if condition is None:
            return
        self._role(condition.role, (*where, "role"))
        event, known = condition.event, self._known.events
        if event is not None and known is not None and event not in known:
            hint = nearest(event, known) or "name it under events: in fleet.yaml, where a program reports it"
            self.report((*where, "event"), f"there is no source of the event {event!r}", hint)

    def _act(self, act: ActConfig, role: str, where: YamlPath) -> None:
        """Check the act of one role."""
        if isinstance(act.goto, str) and isinstance(at_path(self._document.data, (*where, "goto")), str):
            self._place(act.goto, (*where, "goto"))
        value, place = getattr(act, act.verb), (*where, act.verb)
        if act.verb in {"goto", "path"} and self._known.on_earth is False and _is_on_earth(value):
            message = "the site's position on Earth is unknown"
            self.report(place, message, "site: {origin: [latitude, longitude, altitude]} in fleet.yaml")
        files = value if isinstance(value, list) else [value]
        if (
            act.verb in {"path", "plan"}
            and not self._has_files
            and any(isinstance(each, str) for each in files)
        ):
            self.report(place, "a mission that is sent has the content of its files in it")
        for each in files if act.verb == "plan" else ():
            self._plan(each, place)
        if is_for_each(act.verb, value) and role in self._mission.roles:
            most = self._mission.roles[role].count.max
            if len(value) not in (1, most):
                self.report(place, f"{len(value)} files for {most} robots", "one, or one for each")

    def _plan(self, plan: Any, where: YamlPath) -> None:
        """Check a plan written in the mission itself."""
        try:
            if isinstance(plan, dict):
                made_for(plan)
                plan_of(items_of(plan), "")
        except WireError as error:
            self.report(where, f"the plan: {error}")


def _is_on_earth(value: Any) -> bool:
    """Return True if a goal or path has a point on Earth."""
    return isinstance(value, dict) or (isinstance(value, list) and any(map(_is_on_earth, value)))


def _values(inputs: Mapping[str, InputConfig], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all inputs; raises Refused for unknown, missing or invalid ones."""
    for name in given:
        if name not in inputs:
            hint = nearest(name, inputs) or f"it takes {', '.join(inputs) or 'none'}"
            raise Refused(f"there is no input {name!r}", hint=hint)
    values = {}
    for name, each in inputs.items():
        value = given.get(name, each.default)
        trouble = "must be given" if value is None else each.trouble(value)
        if trouble:
            raise Refused(f"input {name}: {trouble}")
        values[name] = value
    return values


def _samples(data: Any) -> dict[str, Any]:
    """Return sample values of the inputs with a valid declaration."""
    inputs = data.get("inputs") if isinstance(data, dict) else None
    found = {}
    for name, each in inputs.items() if isinstance(inputs, dict) else ():
        try:
            found[name] = InputConfig.model_validate(each).sample
        except ValueError:
            continue
    return found
