"""A loaded fleet file with other robots: what an edge runs with after a part of its file was taken over."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from fleet.config.load import Loaded
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig


def with_configs(loaded: Loaded, configs: Mapping[str, AdapterConfig], given: Mapping[str, str]) -> Loaded:
    """Return a loaded file with other configurations of some of its robots."""
    robots = tuple((configs.get(robot.name, robot), plugin) for robot, plugin in loaded.robots)
    return _with(loaded, robots, {**loaded.given, **given})


def with_robot(loaded: Loaded, new: Loaded, name: str) -> Loaded:
    """Return a loaded file with one more robot, that of a new file."""
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
