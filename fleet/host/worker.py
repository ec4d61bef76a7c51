"""The worker process: some of an edge's robots, in a process of their own.

It joins the edge's bus and runs its robots. Its links, dead-men and stops are here; the edge reaches it only
over the bus. Started by the edge, which says on its standard input what it is to run, without the edge's
environment; or by hand on another machine, with a copy of fleet.yaml:
``python -m fleet.host.worker --name arm --config fleet.yaml``.
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
from fleet.bus.session import join
from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.errors import FleetError
from fleet.event_loop import run as run_loop
from fleet.host.keeping import open_kept
from fleet.host.leave import leave
from fleet.host.log_place import log_folder
from fleet.host.logs import Logging, publish_robot_logs, start_logging
from fleet.host.process import RobotProcess
from fleet.host.recall import Recall
from fleet.host.signals import end_by_signal
from fleet.host.stop_inputs import TELL, HeldByEdge
from fleet.host.stops import take_stops
from fleet.host.task import Importer, Task, read_task, task_of
from fleet.host.traffic import Traffic
from fleet.supervisor.client import supervised
from fleet.supervisor.place import VARIABLE, socket_of
from fleet.supervisor.supervisor import Supervisor
from fleet.supervisor.told import told_aside

log = logging.getLogger(__name__)

BEAT = 0.25  # s between signs that the event loop turns


async def run(task: Task, directory: Path, parent: int | None) -> None:
    """Run one worker until a signal ends it, or until ``parent``, the edge that started it, is gone."""
    name, edge, kept = task.worker, task.edge, Path(task.state)
    end_logs = start_logging(Logging.of_a_worker(name), log_folder(kept) / f"worker-{name}.jsonl")
    importer = Importer(Path(task.folder))
    specs = [importer.spec(robot) for robot in task.robots]
    bus = join(task.bus, directory)
    clock = SystemClock()
    journal, history = open_kept(edge, kept, task.history, directory, clock=clock, worker=name)
    process = RobotProcess(
        edge,
        bus,
        specs,
        journal=journal,
        history=history,
        clock=clock,
        worker=name,
        settle=task.settle,
        supervised=supervised(),
        traffic=Traffic(task.site, task.names, clock),
    )
    ended = asyncio.Event()
    end_by_signal(ended.set)
    stop_logs = publish_robot_logs(process)
    stop = take_stops(process, bus, task.groups)
    process.follow_supervisor(stop, ended)
    bus.control.subscribe(keys.halt(edge, name), lambda _key, _payload: process.halt_robots())
    bus.control.subscribe(keys.holders(edge), lambda _key, payload: process.others_have(payload))
    if task.held:
        latches = {robot: process.robots[robot].desk.latch for robot in task.held}
        held = HeldByEdge(latches, ended=partial(_end_motion, process), clock=clock)
        bus.control.subscribe(keys.held(edge), lambda _key, payload: held.take(payload))
        process.wheel.every(TELL, held.look)
    recall = Recall(history)
    if parent is None:  # on another computer, with a file of its own
        bus.control.answer(keys.history(edge), recall.asked)
    # Before the robots start: one that hangs at once is noticed too.
    bus.control.token(keys.worker(edge, name))
    beat = bus.control.publisher(keys.heartbeat(edge, name))

    def show_life() -> None:
        beat.put(b"")
        if parent is not None and os.getppid() != parent and not ended.is_set():
            log.error("the edge is gone: worker %s ends", name)
            ended.set()

    process.wheel.every(BEAT, show_life, failed=lambda _: ended.set())
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


def _end_motion(process: RobotProcess, robot: str, why: str) -> None:
    """End the motion of a robot that is held from now on; from any thread. A landing goes on."""
    process.loop.call_soon_threadsafe(process.robots[robot].desk.end, why)


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
    start_logging(Logging(logging.INFO))
    if given.parent is None and VARIABLE not in os.environ:  # by hand: nobody else would halt its robots
        command = [sys.executable, "-P", "-m", "fleet.host.worker", *sys.argv[1:]]
        path = socket_of(runtime_dir(), os.getpid())
        return Supervisor(command, path=path, told=told_aside, clock=SystemClock()).run()
    try:
        if given.config is None:
            task = read_task(sys.stdin.buffer.read())
        else:
            task = task_of(load(given.config, partial=True), given.name)
        run_loop(run(task, given.directory or runtime_dir(), given.parent))
    except FleetError as error:
        log.error("%s", error)  # noqa: TRY400 - one line for a person, no traceback
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(leave(main()))
