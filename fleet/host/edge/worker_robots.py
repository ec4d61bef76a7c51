"""The edge's side of the robots that run in workers, and what watches the worker processes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.config.load import Loaded
from fleet.host.process.component_settings import worker_of
from fleet.host.process.robot_process import RobotProcess
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_manager import WorkerManager, names_of
from fleet.host.workers.worker_task import task_of
from fleet.model.event import EventKind, EventReport, Severity


def remote_robots(loaded: Loaded, process: RobotProcess) -> dict[str, RemoteRobot]:
    """Return this side of the robots that run in workers, by name; their states are heard from now on."""
    edge, control = process.edge, process.bus.control

    def soon(call: Callable[[], None]) -> None:
        process.loop.call_soon_threadsafe(call)

    remote = {
        robot.name: RemoteRobot(
            robot,
            adapter=plugin.name,
            edge=edge,
            control=control,
            clock=process.clock,
            soon=soon,
            arrival=process.watchdog.arrival,
            worker=worker_of(robot, plugin),
            publish=process.outbox.sender(str(robot.twin)),
        )
        for robot, plugin in loaded.robots
        if worker_of(robot, plugin)
    }
    states = {keys.state(edge, name): robot.state_arrived for name, robot in remote.items()}
    if states:
        control.subscribe_many(keys.state(edge, "*"), states)
    return remote


def worker_managers(
    loaded: Loaded, directory: Path, process: RobotProcess, remote: Mapping[str, RemoteRobot]
) -> dict[str, WorkerManager]:
    """Return what watches each worker process, by name; those that are started by hand have none."""
    names = names_of(robot.worker for robot in remote.values())
    return {
        name: WorkerManager(
            name,
            edge=process.edge,
            task=msgspec.json.encode(task_of(loaded, name)),
            directory=directory,
            control=process.bus.control,
            clock=process.clock,
            told=partial(_worker_is, process, remote),
            halt=partial(_halt_worker, process),
        )
        for name in names
        if name not in loaded.config.remote_workers
    }


def _worker_is(process: RobotProcess, remote: Mapping[str, RemoteRobot], worker: str, cause: str) -> None:
    """Pass on what is wrong with a worker to its robots."""
    for robot in remote.values():
        if robot.worker == worker:
            robot.worker_is(cause)
            if cause:
                lost = EventReport(process.clock.time(), EventKind.LOST, cause, Severity.ERROR)
                process.history.add(robot.name, lost)


def _halt_worker(process: RobotProcess, worker: str) -> None:
    """Halt the robots of a worker that hangs, before it is killed; nobody asked for a stop that stays."""
    process.bus.control.put(keys.halt(process.edge, worker), b"", urgent=True)
