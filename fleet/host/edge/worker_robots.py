"""Edge side of the robots in workers, and the monitoring of the worker processes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.config.load import Loaded
from fleet.host.process.component_settings import worker_of
from fleet.host.process.robot_process import RobotProcess
from fleet.host.runtime.threads import HALT_WAIT, run_in_thread
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_manager import WorkerManager, names_of
from fleet.host.workers.worker_task import task_of
from fleet.model.event import EventKind, EventReport, Severity
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig
from fleet.runtime.exception_barrier import log_exceptions

log = logging.getLogger(__name__)


class RemoteRobots:
    """Robots in workers, ``by_name``, with their states from the bus."""

    def __init__(self, loaded: Loaded, process: RobotProcess) -> None:
        self.by_name: dict[str, RemoteRobot] = {}
        self._process = process
        self._states: dict[str, Callable[[bytes], None]] = {}
        self._listens = False
        for robot, plugin in loaded.robots:
            if worker_of(robot, plugin):
                self.add(robot, plugin)

    def add(self, robot: AdapterConfig, plugin: Plugin) -> RemoteRobot:
        """Add a robot; stops reach it from now on."""
        process = self._process
        edge, control = process.edge, process.bus.control
        made = self.by_name[robot.name] = RemoteRobot(
            robot,
            adapter=plugin.name,
            edge=edge,
            control=control,
            clock=process.clock,
            soon=lambda call: _soon(process, call),
            arrival=process.watchdog.arrival,
            worker=worker_of(robot, plugin),
            publish=process.outbox.sender(str(robot.twin)),
        )
        self._states[keys.state(edge, robot.name)] = made.state_arrived
        if not self._listens:
            self._listens = True
            control.subscribe_many(keys.state(edge, "*"), self._states)
        return made

    def remove(self, robot: RemoteRobot) -> None:
        """Remove a robot."""
        self.by_name.pop(robot.name, None)
        self._states.pop(keys.state(self._process.edge, robot.name), None)
        robot.close()


class Workers:
    """Worker processes of one edge, with their ``managers``; on the event loop."""

    def __init__(
        self, loaded: Loaded, directory: Path, process: RobotProcess, remote: Mapping[str, RemoteRobot]
    ) -> None:
        self._directory, self._process, self._remote = directory, process, remote
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.managers: dict[str, WorkerManager] = {}
        for name in names_of(robot.worker for robot in remote.values()):
            if name not in loaded.config.remote_workers:
                self._make(name, loaded)

    def start(self) -> None:
        """Start all workers."""
        for name in self.managers:
            self._run(name)

    def add(self, name: str, loaded: Loaded) -> WorkerManager:
        """Start one more worker, with its robots of a loaded file."""
        manager = self._make(name, loaded)
        self._run(name)
        return manager

    async def end(self, name: str) -> None:
        """End a worker in order: it brings its robots to a standstill first."""
        task = self._tasks.pop(name)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        self.managers.pop(name).close()

    def cancel(self) -> None:
        """Start ending all workers."""
        for task in self._tasks.values():
            task.cancel()

    async def ended(self) -> None:
        """Wait until all workers have ended."""
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)

    def _make(self, name: str, loaded: Loaded) -> WorkerManager:
        process = self._process
        made = self.managers[name] = WorkerManager(
            name,
            edge=process.edge,
            task=msgspec.json.encode(task_of(loaded, name)),
            directory=self._directory,
            control=process.bus.control,
            clock=process.clock,
            on_problem=partial(_worker_is, process, self._remote),
            halt=partial(_halt_worker, process),
        )
        return made

    def _run(self, name: str) -> None:
        self._tasks[name] = asyncio.create_task(self.managers[name].run(), name=f"worker:{name}")


def _soon(process: RobotProcess, call: Callable[[], None]) -> None:
    """Run a call on the event loop; from any thread."""
    process.loop.call_soon_threadsafe(call)


def _worker_is(process: RobotProcess, remote: Mapping[str, RemoteRobot], worker: str, cause: str) -> None:
    """Pass the problem of a worker to its robots."""
    for robot in list(remote.values()):
        if robot.worker == worker:
            robot.set_worker_problem(cause)
            if cause:
                lost = EventReport(process.clock.time(), EventKind.LOST, cause, Severity.ERROR)
                process.history.add(robot.name, lost)


def _halt_worker(process: RobotProcess, worker: str) -> None:
    """Halt the robots of a hanging worker before it is killed; this sets no emergency stop.

    On a thread of its own: the link to a hanging worker may be full, and the loop serves all other robots.
    """
    put = log_exceptions(log, f"worker {worker}: its robots could not be halted over the bus")
    key = keys.halt(process.edge, worker)
    run_in_thread(partial(put(process.bus.control.put), key, b"", urgent=True), wait=HALT_WAIT)
