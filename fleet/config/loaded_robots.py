"""Variants of a loaded fleet file with other robots, for an edge that has applied part of a changed file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import msgspec
from pydantic import TypeAdapter

from fleet.config.difference import SETTINGS
from fleet.config.load import Loaded
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig

_FIELDS: Mapping[str, TypeAdapter[Any]] = {
    field: TypeAdapter(AdapterConfig.model_fields[field].rebuild_annotation()) for field in SETTINGS
}


def with_configs(loaded: Loaded, configs: Mapping[str, AdapterConfig], given: Mapping[str, str]) -> Loaded:
    """Return a loaded file with other configurations of some of its robots."""
    robots = tuple((configs.get(robot.name, robot), plugin) for robot, plugin in loaded.robots)
    return _with(loaded, robots, {**loaded.given, **given})


def with_settings(loaded: Loaded, name: str, settings: str) -> tuple[AdapterConfig, str]:
    """Return a robot's configuration with other settings (JSON), and the equivalent data of a file."""
    config = next(robot for robot, _ in loaded.robots if robot.name == name)
    said = json.loads(settings)
    known = {field: _FIELDS[field].validate_python(value) for field, value in said.items()}
    given = json.loads(loaded.given[name]) | said
    return config.model_copy(update=known), json.dumps(given)


def with_robot(loaded: Loaded, new: Loaded, name: str) -> Loaded:
    """Return a loaded file with one more robot, taken from a new file."""
    added = next((robot, plugin) for robot, plugin in new.robots if robot.name == name)
    return _with(loaded, (*loaded.robots, added), {**loaded.given, name: new.given[name]})


def without_robot(loaded: Loaded, name: str) -> Loaded:
    """Return a loaded file without one of its robots."""
    robots = tuple((robot, plugin) for robot, plugin in loaded.robots if robot.name != name)
    return _with(loaded, robots, {other: given for other, given in loaded.given.items() if other != name})


def _with(
    loaded: Loaded, robots: tuple[tuple[AdapterConfig, Plugin], ...], given: Mapping[str, str]
) -> Loaded:
    config = loaded.config.model_copy(update={"robots": tuple(robot for robot, _ in robots)})
    return msgspec.structs.replace(loaded, config=config, robots=robots, given=dict(given))
