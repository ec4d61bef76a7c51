"""Worker process: some of an edge's robots, in a process of their own.

It joins the edge's bus and runs its robots. Its links, dead-men and stops are here; the edge reaches it only
over the bus. Started by the edge, which writes its task to its standard input, without the edge's
environment; or on another computer, with a copy of fleet.yaml: ``fleet run --worker arm fleet.yaml``.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import sys
from functools import partial
from pathlib import Path

from fleet.bus import keys
from fleet.bus.bus import join
from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.errors import FleetError
from fleet.host.journal.stores import open_stores
from fleet.host.logs.folders import log_folder
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.process.common_start import serve_common_starts
from fleet.host.process.component_settings import settle_time_beside
from fleet.host.process.driverlog import publish_robot_logs
from fleet.host.process.history_service import HistoryService
from fleet.host.process.interrupted_commands import report_interrupted_commands
from fleet.host.process.robot_process import RobotProcess
from fleet.host.process.stop_inputs import TELL, HeldByEdge
from fleet.host.process.stop_service import serve_stops
from fleet.host.robot.robot_positions import RobotPositions
from fleet.host.runtime.shutdown import shutdown
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.host.workers.holding import HoldService
from fleet.host.workers.reload import RELOADED, Reload
from fleet.host.workers.worker_task import Importer, WorkerTask, read_task, task_of
from fleet.runtime.event_loop import run as run_loop
from fleet.runtime.realtime import NOT_PERMITTED, prefer_loop
from fleet.supervisor.client import SupervisorClient, connect_supervisor

log = logging.getLogger(__name__)

BEAT = 0.25  # s between heartbeats of the event loop


async def run(task: WorkerTask, directory: Path, parent: int | None) -> int:
    """Run one worker until a signal ends it, or until ``parent``, the edge that started it, is gone.

    Returns the exit code: ``RELOADED`` for a worker that is to be restarted.
    """
    name, edge, kept = task.worker, task.edge, Path(task.state)
    end_logs = start_logging(LogSettings.of_a_worker(name), log_folder(kept) / f"worker-{name}.jsonl")
    specs = list(map(Importer(Path(task.folder)).spec, task.robots))
    bus = join(task.bus, directory)
    clock = SystemClock()
    journal, history = open_stores(edge, kept, task.history, directory, clock=clock, worker=name)
    process = RobotProcess(
        edge,
        bus,
        specs,
        journal=journal,
        history=history,
        clock=clock,
        worker=name,
        settle=max(task.settle, settle_time_beside(edge, directory)),
        supervised=connect_supervisor(),
        traffic=RobotPositions(task.site, task.names, clock, edge=edge, partners=task.partners),
    )
    ended = asyncio.Event()
    end_by_signal(ended.set)
    stop_logs = publish_robot_logs(process)
    stop = serve_stops(process, bus, task.groups)
    serve_common_starts(process)
    process.follow_supervisor(stop, ended)
    bus.control.subscribe(keys.halt(edge, name), lambda _key, _payload: process.halt_robots())
    bus.control.subscribe(keys.holders(edge), lambda _key, payload: process.holders.read(payload))
    if task.held:
        latches = {robot: process.robots[robot].controller.latch for robot in task.held}
        held = HeldByEdge(latches, ended=partial(_end_motion, process), clock=clock)
        bus.control.subscribe(keys.held(edge), lambda _key, payload: held.apply(payload))
        process.scheduler.every(TELL, held.check)
    reload = Reload(task, process.robots.values, end=ended.set, started_by_hand=parent is None)
    bus.control.declare_queryable(keys.reload(edge, name), reload.requested)
    bus.control.declare_queryable(
        keys.hold(edge, name), HoldService(process.robots, task.groups, task.folder).requested
    )
    recall = HistoryService(history)
    if parent is None:  # on another computer, with a history of its own
        bus.control.declare_queryable(keys.history(edge), recall.requested)
    # Before the robots start: one that hangs at once is detected too.
    bus.control.token(keys.worker(edge, name))
    beat = bus.control.publisher(keys.heartbeat(edge, name))

    def show_life() -> None:
        beat.put(b"")
        if parent is not None and os.getppid() != parent and not ended.is_set():
            log.error("the edge is gone: worker %s ends", name)
            ended.set()

    journal.ends_are_reported = lambda: edge_lives(process.supervised, parent)
    process.scheduler.every(BEAT, show_life, failed=lambda _: ended.set())
    report_interrupted_commands(process, process.robots.values())
    process.start()
    process.supervised.running()
    try:
        await ended.wait()
        process.supervised.ending()
    finally:
        await process.stop()
        stop_logs()
        bus.close()
        recall.close()
        await process.close()
        end_logs()
    return RELOADED if reload.reloaded else 0


def edge_lives(supervised: SupervisorClient, parent: int | None) -> bool:
    """Return whether the edge can still report how commands ended; ``parent`` is its process, None elsewhere.

    A process that dies closes its sockets before its children get another parent, so the supervisor knows
    first: a command that this worker ends in between would otherwise count as reported.
    """
    return not supervised.edge_gone and (parent is None or os.getppid() == parent)


def _end_motion(process: RobotProcess, robot: str, why: str) -> None:
    """End the motion of a robot that has become held; from any thread. A landing goes on."""
    process.loop.call_soon_threadsafe(process.robots[robot].controller.end, why)


def main() -> int:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(description="Runs the robots of one worker of fleet.yaml.")
    parser.add_argument("--name", help="the worker's name, as the robots give it")
    parser.add_argument("--config", type=Path, help="fleet.yaml; left out: the edge says what to run")
    parser.add_argument("--directory", type=Path, help="where the edge's sockets are")
    parser.add_argument("--parent", type=int, help="end when this process, the edge, is gone")
    given = parser.parse_args()
    if (given.name is None) != (given.config is None):
        parser.error("--name and --config come together")
    start_logging(LogSettings(logging.INFO))
    try:
        if given.config is None:
            task = read_task(sys.stdin.buffer.read())
        else:
            task = task_of(load(given.config, partial=True), given.name)
        if task.realtime and not prefer_loop():
            log.warning(NOT_PERMITTED)
        return run_loop(run(task, given.directory or runtime_dir(), given.parent))
    except FleetError as error:
        log.error("%s", error)  # noqa: TRY400 - one line for a person, no traceback
        return 1


if __name__ == "__main__":
    sys.exit(shutdown(main()))
