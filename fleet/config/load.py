"""fleet.yaml to a validated fleet: ``load`` is the first step of ``fleet run`` and ``fleet check``.

Two passes: the outline gives the folders and adapters; then the ``Config`` of its adapter validates every
robot. All errors are reported together.
"""

from __future__ import annotations

import difflib
import json
import os
import pathlib
import re
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
from pydantic import ConfigDict, Field

from fleet.config.checks import (
    check_bus,
    check_consoles,
    check_followers,
    check_names,
    check_robots,
    check_workers,
    warn_of_adapters,
    warn_of_batteries,
    warn_of_drop_ins,
    warn_of_places,
)
from fleet.config.drop_in import DropInConfig, requested
from fleet.config.environment import cloud_from_environment
from fleet.config.explain import validated, validated_with
from fleet.config.groups import check_groups, contradiction, said_by_groups
from fleet.config.identity import ValueIdentity, identity_of
from fleet.config.known import known_of
from fleet.config.mission_routes import check_routes
from fleet.config.missions import Mission, check_missions
from fleet.config.pair import check_pair, choose_edge
from fleet.config.places import check_places
from fleet.config.problems import InvalidConfig, Problem, YamlPath
from fleet.config.schema import FleetConfig, Sections
from fleet.config.text import nearest
from fleet.config.yaml import Document, read
from fleet.plugins.probe import CheckedConfig
from fleet.plugins.registry import Plugin, PluginState, Registry
from fleet.robot_config import AdapterConfig

_OWN_TO_ROBOT = ("name", "twin", "adapter")  # fields that defaults cannot give
_OTHER_ADAPTERS = "for another, install its package here or name the folder of its file in plugins"
_ROBOT_PATH = re.compile(r"robots\[(\d+)\]")

_EXAMPLE_HINT = "fleet init writes an example"


class Loaded(msgspec.Struct, frozen=True):
    """A fleet that can run.

    ``robots`` pairs each robot's config with its plugin (always loaded); ``given`` has, by robot, the data
    (JSON) that its adapter's Config accepted, relative to ``folder``. If the fleet was loaded partially,
    ``problems`` says why the other robots cannot run, and ``config`` (including its groups) has only those
    that can. ``warnings`` need a person's attention, but do not prevent the run. ``secrets`` must never be
    shown.
    """

    config: FleetConfig
    registry: Registry
    robots: tuple[tuple[AdapterConfig, Plugin], ...]
    folder: pathlib.Path
    given: Mapping[str, str]
    problems: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    missions: tuple[Mission, ...] = ()
    file: pathlib.Path = pathlib.Path("fleet.yaml")
    secrets: frozenset[str] = frozenset()


class _ValidRobot(msgspec.Struct, frozen=True):
    """A robot accepted by its own adapter's Config."""

    config: AdapterConfig
    plugin: Plugin
    identity: ValueIdentity | None
    given: str


class _UncheckedFile(Sections):
    """fleet.yaml with unvalidated robots."""

    robots: list[Any] = Field(min_length=1, description="- {name: ..., twin: ..., adapter: ...}")


class _HostFields(AdapterConfig):
    """The part of a robot that can be validated without its adapter."""

    model_config = ConfigDict(extra="ignore")


def load(
    path: str | os.PathLike[str],
    environ: Mapping[str, str] | None = None,
    *,
    partial: bool = False,
    registry: Registry | None = None,
) -> Loaded:
    """Read and validate a fleet file; drop-in files are inspected by separate processes.

    With ``partial``, a robot that cannot run is left out and reported in ``problems``; errors outside the
    robots, and a fleet without any valid robot, are still fatal. Raises InvalidConfig (a ConfigError) with
    every error.
    """
    if registry is not None:
        return _load(pathlib.Path(path), os.environ if environ is None else environ, partial, registry)
    registry = Registry()
    try:
        return _load(pathlib.Path(path), os.environ if environ is None else environ, partial, registry)
    finally:
        registry.close()


def _load(file: pathlib.Path, environ: Mapping[str, str], partial: bool, registry: Registry) -> Loaded:  # noqa: FBT001 - by position
    """Load with a given registry."""
    document = read(file, environ, if_missing=_EXAMPLE_HINT)
    if not _is_mapping(document):
        raise InvalidConfig(document.problems)
    data = document.data
    cloud_from_environment(document, environ)
    choose_edge(document, environ)
    for folder in _folders(data, file.parent):
        registry.add_folder(folder)
    context = {"folder": file.parent}
    sections = _sections(document, context)
    robots = _robots(document, registry, context)
    _check_together(document, sections, robots)
    missions = check_missions(data, document, file.parent, known_of(data))
    check_routes(document, sections, (made.config for made in robots.values()), missions)
    _warn(document, sections, robots)
    problems = tuple(sorted(set(document.problems), key=_place_in_file))
    runnable = _runnable(robots, problems)
    fatal = not runnable or _is_fatal(problems) or not partial
    if sections is None or (problems and fatal):
        raise InvalidConfig(problems)
    config = FleetConfig(
        **{
            **dict(sections),
            "groups": _groups_of(sections, runnable),
            "robots": tuple(config for config, _ in runnable),
        }
    )
    given = {made.config.name: made.given for made in robots.values()}
    warnings, secrets, known = tuple(document.warnings), frozenset(document.secrets), tuple(missions)
    return Loaded(config, registry, runnable, file.parent, given, problems, warnings, known, file, secrets)


def _check_together(document: Document, sections: Sections | None, robots: Mapping[int, _ValidRobot]) -> None:
    """Report contradictions between parts of a fleet file that are valid by themselves."""
    identities = {index: robot.identity for index, robot in robots.items() if robot.identity}
    check_robots(document.data.get("robots"), identities, document)
    check_groups(document.data, document)
    check_names(document.data, document)
    check_pair({index: (robot.config, robot.plugin) for index, robot in robots.items()}, document)
    configs = {index: robot.config for index, robot in robots.items()}
    check_followers(configs, document)
    if sections is not None:
        check_bus(sections.bus, document)
        check_workers(sections, document)
        check_consoles(sections, document)
        check_places(sections.places, configs.values(), sections.site.origin, document)


def _warn(document: Document, sections: Sections | None, robots: Mapping[int, _ValidRobot]) -> None:
    """Add warnings that need a person's attention."""
    configs = {index: robot.config for index, robot in robots.items()}
    warn_of_adapters({index: made.plugin for index, made in robots.items()}, document)
    warn_of_batteries(configs, document)
    warn_of_drop_ins({index: made.config for index, made in robots.items() if made.plugin.file}, document)
    at_home = [index for index, robot in robots.items() if getattr(robot.plugin.adapter, "tells_home", False)]
    has_site = sections is not None and sections.site.origin is not None
    has_partners = sections is not None and any(each.robots for each in sections.partners.values())
    warn_of_places(configs, at_home, has_site=has_site, has_partners=has_partners, document=document)


def sections_of(path: str | os.PathLike[str], environ: Mapping[str, str] | None = None) -> Sections:
    """Return the sections of a fleet file without its robots; no adapter is imported or inspected.

    Raises InvalidConfig for errors in the sections; errors in robots are ignored.
    """
    file = pathlib.Path(path)
    environ = os.environ if environ is None else environ
    document = read(file, environ, if_missing=_EXAMPLE_HINT)
    if not _is_mapping(document):
        raise InvalidConfig(document.problems)
    cloud_from_environment(document, environ)
    choose_edge(document, environ)
    document.data.pop("robots", None)  # no robots are needed to look at edges
    sections = _sections(document, {"folder": file.parent}, Sections)
    if sections is None or _is_fatal(document.problems):
        raise InvalidConfig(document.problems)
    return sections


def _sections(
    document: Document, context: Mapping[str, object], kind: type[Sections] = _UncheckedFile
) -> Sections | None:
    """Return the sections without the robots; None after reporting the errors."""
    known = {key: value for key, value in document.data.items() if not key.startswith("x-")}
    return validated(kind, known, (), document, context)


def _is_fatal(problems: Iterable[Problem]) -> bool:
    """Return True for errors outside the robots."""
    return any(not _ROBOT_PATH.match(problem.path) for problem in problems)


def registry_for(
    path: str | os.PathLike[str],
    environ: Mapping[str, str] | None = None,
    registry: Registry | None = None,
) -> Registry:
    """Return the adapters available to a fleet file, whatever other errors it has.

    Raises InvalidConfig if the file cannot be read at all.
    """
    file = pathlib.Path(path)
    registry = registry or Registry()
    document = read(file, os.environ if environ is None else environ, if_missing=_EXAMPLE_HINT)
    if not _is_mapping(document):
        raise InvalidConfig(document.problems)
    for folder in _folders(document.data, file.parent):
        registry.add_folder(folder)
    return registry


def _place_in_file(problem: Problem) -> tuple[str, int, int]:
    return problem.file, problem.line, problem.column


def _is_mapping(document: Document) -> bool:
    """Return True if the file is a mapping; otherwise report that it is not."""
    if isinstance(document.data, dict):
        return True
    if () not in document.spoiled:
        message = "the file is empty" if document.data is None else "must be a mapping of  key: value"
        document.report(document.marks[()], message, _EXAMPLE_HINT)
    return False


def _folders(data: Mapping[str, object], folder: pathlib.Path) -> Iterable[pathlib.Path]:
    """Return the existing drop-in folders; missing ones are reported with the sections."""
    named = data.get("plugins")
    for name in named if isinstance(named, list) else ():
        if isinstance(name, str) and (folder / name).is_dir():
            yield folder / name


def _robots(document: Document, registry: Registry, context: Mapping[str, object]) -> dict[int, _ValidRobot]:
    """Return the valid robots, by index in the list."""
    listed = document.data.get("robots")
    made = {}
    for index, robot in enumerate(listed if isinstance(listed, list) else ()):
        found = _robot(robot, ("robots", index), document, registry, context)
        if found:
            made[index] = found
    return made


def _robot(
    robot: object, at: YamlPath, document: Document, registry: Registry, context: Mapping[str, object]
) -> _ValidRobot | None:
    """Validate one robot with its adapter's Config; None after reporting the errors."""
    if at in document.spoiled:
        return None
    merged = _with_defaults(robot, at, document)
    plugin = _plugin(merged, at, document, registry)
    if plugin is not None and plugin.description is not None:
        return _dropped_in(
            plugin, requested(registry, plugin, merged, at=at, document=document, context=context)
        )
    if plugin is None or plugin.adapter is None:
        validated(_HostFields, merged, at, document, context)
        return None
    try:
        found = validated_with(plugin.adapter.Config, merged, at, document, context)
        return _ValidRobot(found[0], plugin, identity_of(found[0]), json.dumps(found[1])) if found else None
    except KeyboardInterrupt:
        raise
    # The validators are the adapter's own code.
    except BaseException as error:  # noqa: BLE001
        reason = f"{type(error).__name__}: {error}"
        document.report(document.marks[at], f"the adapter {plugin.name!r} failed to check it", reason)
        return None


def _dropped_in(plugin: Plugin, found: tuple[DropInConfig, CheckedConfig] | None) -> _ValidRobot | None:
    """Return a robot accepted by its drop-in file."""
    if found is None:
        return None
    config, said = found
    identity = None if said.identity is None else (plugin.name, said.identity)
    return _ValidRobot(config, plugin, identity, said.given)


def _plugin(robot: object, at: YamlPath, document: Document, registry: Registry) -> Plugin | None:
    """Return the plugin of a robot; None after reporting why there is none."""
    path = (*at, "adapter")
    if not isinstance(robot, dict) or path in document.spoiled:
        return None
    known = f"known adapters: {', '.join(registry.names()) or 'none is installed'}"
    if "adapter" not in robot:
        _report_no_adapter(robot, at, document, known)
        return None
    name = robot["adapter"]
    plugin = registry.get(name) if isinstance(name, str) else None
    if plugin is None:
        near = nearest(str(name), registry.names()) or f"{known}; {_OTHER_ADAPTERS}"
        failed = [f"{file.origin} failed: {file.report}" for file in registry.broken_files()]
        document.report(document.marks[path], f"there is no adapter {name!r}", "; ".join([near, *failed]))
    elif plugin.state is PluginState.FAILED:
        document.report(document.marks[path], f"the adapter {name!r} cannot be used", plugin.report)
    return plugin


def _report_no_adapter(robot: Mapping[str, object], at: YamlPath, document: Document, hint: str) -> None:
    """Report a missing adapter, at the key that is perhaps a misspelling."""
    near = difflib.get_close_matches("adapter", robot, n=1)
    if near:
        document.report(document.keys[*at, near[0]], "unknown key", "did you mean 'adapter'?")
    else:
        document.report(document.marks[at], "the key 'adapter' is missing", hint)


def _with_defaults(robot: object, at: YamlPath, document: Document) -> object:
    """Return a robot completed by its groups, then by the defaults; the positions are merged as well."""
    defaults = document.data.get("defaults")
    if not isinstance(robot, dict):
        return robot
    robot = _with_groups(robot, at, document)
    if not isinstance(defaults, dict):
        return robot
    under = {key: value for key, value in defaults.items() if key not in _OWN_TO_ROBOT}
    return _merged(under, robot, ("defaults",), at, document)


def _with_groups(robot: dict[str, object], at: YamlPath, document: Document) -> object:
    """Return a robot completed by its groups; reports contradictions between them."""
    name = str(robot.get("name", ""))
    said = [
        (place, {key: _unsaid(value, robot.get(key)) for key, value in under.items()})
        for place, under in said_by_groups(name, document)
    ]
    for number, (place, under) in enumerate(said):
        if any(contradiction(under, earlier) for _, earlier in said[:number]):
            message = f"another group of {name} says something else of it"
            document.report(document.marks[place], message, "say it at the robot itself")
    merged: object = robot
    for place, under in said:
        merged = _merged(under, merged, place, at, document)
    return merged


def _unsaid(value: object, own: object) -> object:
    """Return the settings of a group that the robot does not give itself."""
    if not isinstance(value, dict) or not isinstance(own, dict):
        return value
    return {key: each for key, each in value.items() if key not in own}


def _merged(under: object, over: object, under_at: YamlPath, over_at: YamlPath, document: Document) -> object:
    """Merge mappings key by key; other values of ``over`` win."""
    if not (isinstance(under, dict) and isinstance(over, dict)):
        return over
    merged = dict(over)
    for key, value in under.items():
        source, target = (*under_at, key), (*over_at, key)
        if key in over:
            merged[key] = _merged(value, over[key], source, target, document)
        else:
            merged[key] = value
            document.copy_marks(source, target, value)
    return merged


def _runnable(
    robots: Mapping[int, _ValidRobot], problems: Iterable[Problem]
) -> tuple[tuple[AdapterConfig, Plugin], ...]:
    """Return the robots without errors, in the order of the file."""
    matches = (_ROBOT_PATH.match(problem.path) for problem in problems)
    broken = {int(match[1]) for match in matches if match}
    return tuple((made.config, made.plugin) for index, made in robots.items() if index not in broken)


def _groups_of(
    sections: Sections, robots: Iterable[tuple[AdapterConfig, Plugin]]
) -> dict[str, tuple[str, ...]]:
    """Return the groups with only the robots that run."""
    names = {config.name for config, _ in robots}
    return {group: tuple(name for name in them if name in names) for group, them in sections.members.items()}
