"""Task of a worker: only its own robots and its connection to the bus, no other part of fleet.yaml.

The edge writes it to the worker's standard input; a worker started by hand makes it from its own copy of
fleet.yaml. It contains neither the cloud and its token nor the configuration of other robots.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from fleet.adapter import AnyAdapter
from fleet.bus.settings import BusSettings
from fleet.config.explain import checked
from fleet.config.load import Loaded
from fleet.errors import ConfigError
from fleet.history.store import HistoryBounds
from fleet.host.journal.stores import history_bounds
from fleet.host.process.component_settings import bus_access, bus_settings, settle_time, worker_of
from fleet.host.process.robot_process import RobotSpec
from fleet.host.process.stop_inputs import robots_of
from fleet.host.robot.robot_positions import partner_robots
from fleet.model.geodesy import GeoOrigin
from fleet.plugins.drop_in_file import Imported, import_file, insecure
from fleet.plugins.registry import Plugin, Registry
from fleet.runtime.decoding import decode_json
from fleet.spool.state_folder import state_folder


class RobotTask(msgspec.Struct, frozen=True):
    """One robot: name of its adapter, drop-in file (empty: installed adapter), config (JSON)."""

    name: str
    adapter: str
    file: str
    given: str


class WorkerTask(msgspec.Struct, frozen=True):
    """Task of one worker.

    ``state``: the edge's folder of persistent state, with a ``history`` of these bounds; ``settle``: seconds
    to wait for other edges' claims; ``folder``: base of relative paths; ``names``: all robots of the edge;
    ``partners``: the other edges' robots by name, with their edge; ``held``: robots of this worker that a
    stop input stops; ``realtime``: whether its event loop is to have real-time priority.
    """

    worker: str
    edge: str
    bus: BusSettings
    state: str
    history: HistoryBounds
    settle: float
    folder: str
    names: tuple[str, ...]
    groups: dict[str, list[str]]
    robots: tuple[RobotTask, ...]
    held: tuple[str, ...] = ()
    site: GeoOrigin | None = None
    partners: dict[str, str] = {}
    realtime: bool = False


def task_of(loaded: Loaded, worker: str) -> WorkerTask:
    """Return the task of a worker."""
    config = loaded.config
    origin = config.site.origin
    robots = tuple(robot_tasks(loaded, worker))
    return WorkerTask(
        worker=worker,
        edge=config.edge.id,
        bus=bus_settings(config, bus_access(config)),
        state=str(state_folder(config.edge.id, config.edge.spool.path).absolute()),
        history=history_bounds(config),
        settle=settle_time(config),
        folder=str(loaded.folder.absolute()),
        names=tuple(robot.name for robot in config.robots),
        groups={group: list(names) for group, names in config.members.items()},
        robots=robots,
        held=robots_of(config.stop_inputs, config.members, (robot.name for robot in robots)),
        site=GeoOrigin(*origin) if origin else None,
        partners=partner_robots(config),
        realtime=config.edge.realtime,
    )


def robot_tasks(loaded: Loaded, worker: str) -> Iterable[RobotTask]:
    """Yield the robots of a worker; of the edge's own process when ``worker`` is empty."""
    for robot, plugin in loaded.robots:
        if worker_of(robot, plugin) == worker:
            file = str(plugin.file.absolute()) if plugin.file else ""
            yield RobotTask(robot.name, plugin.name, file, loaded.given[robot.name])


def specs_here(loaded: Loaded) -> list[RobotSpec]:
    """Return the robots of the edge's own process; drop-in files among them are imported now.

    Raises ConfigError for an adapter that cannot be imported here.
    """
    importer = Importer(loaded.folder, loaded.registry)
    return [importer.spec(task) for task in robot_tasks(loaded, "")]


def read_task(payload: bytes) -> WorkerTask:
    """Return the task that the edge wrote; raises ConfigError."""
    try:
        return decode_json(payload, WorkerTask)
    except msgspec.DecodeError as error:
        raise ConfigError(f"the task of this worker cannot be read: {error}") from None


class Importer:
    """Imports the adapters of the robots of this process, each drop-in file once."""

    def __init__(self, folder: Path, registry: Registry | None = None) -> None:
        self._folder = folder
        self._registry = registry or Registry()
        self._files: dict[str, Imported] = {}

    def spec(self, task: RobotTask) -> RobotSpec:
        """Return a robot with its own config; raises ConfigError when its adapter is unusable here."""
        adapter: Any = self._from_file(task) if task.file else self._installed(task)
        try:
            config = checked(adapter.Config, msgspec.json.decode(task.given), {"folder": self._folder})
        except Exception as error:  # noqa: BLE001 - the validators are the adapter's own code
            raise ConfigError(f"{task.name}: its config is refused here: {error}") from None
        return RobotSpec(config, adapter, task.adapter, task.file)

    def _from_file(self, task: RobotTask) -> type[AnyAdapter]:
        """Return the adapter of a drop-in file."""
        path = Path(task.file)
        if unsafe := insecure(path.parent) or insecure(path):
            raise ConfigError(f"{task.name}: {path}: {unsafe}")
        if task.file not in self._files:
            self._files[task.file] = import_file(path)
        imported = self._files[task.file]
        found = dict(imported.adapters).get(task.adapter)
        if found is None:
            reports = "; ".join(imported.reports)
            why = f": {reports}" if reports else ""
            raise ConfigError(f"{task.name}: {path} has no adapter {task.adapter!r}{why}")
        return found

    def _installed(self, task: RobotTask) -> type[AnyAdapter]:
        """Return an installed adapter."""
        plugin: Plugin | None = self._registry.get(task.adapter)
        if plugin is None or plugin.adapter is None:
            report = plugin.report if plugin else "it is not installed"
            raise ConfigError(f"{task.name}: the adapter {task.adapter!r} cannot be used: {report}")
        return plugin.adapter
