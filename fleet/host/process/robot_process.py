"""The robots of one process, the edge's or a worker's, with its scheduler, watchdog and bus."""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import logging
import os
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.clock import Clock
from fleet.history.store import History
from fleet.host.journal.journal import Journal, RobotJournal
from fleet.host.logs.rotating_file import log_and_flush
from fleet.host.process.adapter_runs import AdapterRuns
from fleet.host.process.frame_publisher import FramePublisher
from fleet.host.process.robot_endpoints import RobotEndpoints
from fleet.host.process.setpoints import Setpoints
from fleet.host.process.twin_holders import TwinHolders
from fleet.host.process.video_relay import relay_video
from fleet.host.requests.bus_senders import BusSenders
from fleet.host.requests.stop_cause import StopCause, local_cause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.report_queue import ReportQueue
from fleet.host.robot.robot_positions import RobotPositions, exchange
from fleet.host.runtime.cpu_starvation import CpuStarvation
from fleet.host.runtime.loop_monitor import LoopMonitor
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.threads import HALT_WAIT, call_sequentially, run_in_thread
from fleet.host.runtime.tick_scheduler import PeriodicCall, TickScheduler
from fleet.host.runtime.watchdog import LoopWatch, Watchdog
from fleet.link.tap import OPENING
from fleet.robot_config import MAIN
from fleet.runtime.interpreter import freeze_new_objects, interpreter_settings
from fleet.supervisor.client import SupervisorClient
from fleet.supervisor.protocol import StopRequest

log = logging.getLogger(__name__)

SWITCH_INTERVAL = 0.0001  # s that a thread keeps the GIL while another one waits for it
SETTLED = 5.0  # s after which most long-lived objects exist
YOUNG = 20_000  # net new objects that start a collection of the youngest generation
STATE_EVERY = 1.0  # s between states of a robot that does not change
SHUTDOWN = 8.0  # s for all robots to come to a standstill when the process ends
FLUSH_TIMEOUT = 1.0  # s for the last log line before the process exits


class RobotSpec(msgspec.Struct, frozen=True):
    """A robot to run here: its config, its adapter's class and name, and its drop-in file if it has one."""

    config: Any
    plugin: Any
    adapter: str
    file: str = ""


class RobotService(Protocol):
    """A service for each robot of a process, which keeps little for each: there may be a thousand."""

    def join(self, robot: LocalRobot) -> None:
        """Begin to serve a robot."""

    def leave(self, robot: LocalRobot) -> None:
        """Stop serving a robot; no effect on one that was never served."""


class RobotProcess:
    """The robots of one process; ``close`` closes journal and history, after ``stop``.

    ``history`` records requests, requesters and outcomes; the journal's thread writes it. ``settle``: seconds
    in which other edges can show the twins that they hold, before a robot is run. ``services`` serve each
    robot besides, from ``serve`` to ``drop``. ``traffic`` has the positions of all robots of the edge and its
    partners; without it they are not kept apart. ``alone``: all robots of the edge were in this process when
    it started, so it can take the queries to all of them.
    """

    def __init__(
        self,
        edge: str,
        bus: Bus,
        specs: Iterable[RobotSpec],
        *,
        journal: Journal,
        history: History,
        clock: Clock,
        worker: str = "",
        settle: float = 0.0,
        supervised: SupervisorClient | None = None,
        traffic: RobotPositions | None = None,
        alone: bool = False,
    ) -> None:
        self.edge = edge
        self.alone = alone
        self.bus = bus
        self.clock = clock
        self.worker = worker
        self.journal = journal
        self.history = history
        self.loop = asyncio.get_running_loop()
        self.scheduler = TickScheduler(self.loop, clock)
        self.outbox = ReportQueue(bus.reports)
        self._frames = FramePublisher(keys.frames(edge, worker or MAIN), bus.reports, clock)
        self.supervised = supervised or SupervisorClient()
        self._thread = LoopMonitor(self.loop)
        self.starvation = CpuStarvation(clock.monotonic(), self._thread.waited())
        self._shared = SharedResources()
        self.runs = AdapterRuns(lambda robot: self.holders.update(robot))  # noqa: PLW0108 - they are made below
        self._state_calls: dict[str, PeriodicCall] = {}  # publish the state of each robot
        self.services: list[RobotService] = []
        self._setpoints = Setpoints(bus.reports, self.loop)
        self._states = bus.control.publishers(keys.state(edge, "*"))
        self._settling: asyncio.TimerHandle | None = None
        self._interpreter = contextlib.ExitStack()  # interpreter settings while the robots run
        self.watchdog = Watchdog(
            clock,
            LoopWatch(
                beat=lambda: self.scheduler.beat,
                cpu=self._thread.cpu,
                waited=self._thread.waited,
                running=self._running,
                blocked=self._blocked,
                stuck=self._stuck,
            ),
        )
        self.robots: dict[str, LocalRobot] = {spec.config.name: self._make(spec) for spec in specs}
        self.traffic = traffic
        if traffic is not None:
            for robot in self.robots.values():
                robot.share_space(traffic)
            exchange(traffic, worker or MAIN, bus.control, self.scheduler)
        self.senders = BusSenders(bus.consoles, bus.people, history.add, clock)
        self._endpoints = RobotEndpoints(edge, bus, self.senders, alone=alone)
        self.holders = TwinHolders(edge, bus.control, self.robots, self.runs, settle=settle, clock=clock)
        self.claims = self.holders.claims
        self.on_stop: Callable[[tuple[str, ...], StopCause], None] = lambda _names, _cause: None
        # Called before the robots are looked up; it must neither wait nor raise.
        self.stop_requested: Callable[[tuple[str, ...], StopCause], None] = lambda _names, _cause: None

    def _make(self, spec: RobotSpec, journal: RobotJournal | None = None) -> LocalRobot:
        """Build one robot; the links that it opens leave copies of their frames for a recorder."""
        context = contextvars.copy_context()
        context.run(OPENING.set, self._frames.opening(spec.config.name, spec.plugin.redaction))
        return context.run(
            LocalRobot,
            spec.config,
            spec.plugin,
            adapter=spec.adapter,
            drop_in=spec.file,
            edge=self.edge,
            worker=self.worker,
            clock=self.clock,
            scheduler=self.scheduler,
            shared=self._shared,
            outbox=self.outbox,
            journal=journal or self.journal.robot(spec.config.name),
            record=partial(self.history.add, spec.config.name),
            arrival=self.watchdog.arrival,
            changed=self.publish_state,
            supervised=self.supervised,
        )

    def start(self) -> None:
        """Start all robots; the runner of a robot retries it when it fails."""
        # A thread that stops a robot must not wait long for the GIL. A full garbage collection stops all
        # threads: for a quarter of a second with a thousand robots, in which no dead-man switch works. So
        # long-lived objects are frozen (excluded from collection), now and again after SETTLED. A young
        # collection delays a command by a third of a millisecond; reference counting frees nearly all
        # objects, so it may be rare.
        self._interpreter.enter_context(interpreter_settings(switch_interval=SWITCH_INTERVAL, young=YOUNG))
        self._settling = self.loop.call_later(SETTLED, freeze_new_objects)
        for robot in self.robots.values():
            self._show(robot)
        self._setpoints.start(self.robots.values())
        for robot in self.robots.values():
            self._setpoints.follow(robot)
        self.scheduler.every(STATE_EVERY, self._look_at_processor)
        self.claims.start()
        self.scheduler.at_end(self.outbox.flushing)
        self.scheduler.at_end(self._frames.flushing)
        self.scheduler.start()
        self.watchdog.start()

    def add(self, spec: RobotSpec, journal: RobotJournal) -> LocalRobot:
        """Build a robot while others run; stops reach it from now on, but it is run only after ``serve``."""
        robot = self._make(spec, journal)
        if self.traffic is not None:
            robot.share_space(self.traffic)
        self.robots[robot.name] = robot
        self.runs.pause(robot)
        return robot

    def serve(self, robot: LocalRobot) -> None:
        """Serve an added robot on the bus, and run it once this edge holds its twin."""
        self._show(robot)
        self._setpoints.add(robot)
        self._setpoints.follow(robot)
        self.claims.begin(robot.twin)
        self.runs.resume(robot)

    def drop(self, robot: LocalRobot) -> None:
        """Remove a robot whose run has ended, or that was never served; its twin stays claimed."""
        self.robots.pop(robot.name, None)
        self.runs.forget(robot)
        with contextlib.ExitStack() as service:  # ended last, and each part though another fails
            if call := self._state_calls.pop(robot.name, None):
                service.callback(call.cancel)
            service.callback(self._setpoints.remove, robot)
            for each in (self._endpoints, *self.services):
                service.callback(each.leave, robot)
            for watched in (robot.name, f"{robot.name} joints"):
                self.watchdog.remove(watched)
            self.scheduler.end(robot.name)
            self.outbox.drop(robot.twin)
            if self.traffic is not None:
                self.traffic.leave(robot.name)

    async def stop(self) -> None:
        """Bring every robot moved by this process to a standstill, and end all runs."""
        self.runs.ending = True
        for task in self.runs.tasks.values():
            task.cancel()
        if self.runs.tasks:
            _, late = await asyncio.wait(self.runs.tasks.values(), timeout=SHUTDOWN)
            for task in late:
                log.error("%s did not end within %g s", task.get_name(), SHUTDOWN)
        self.outbox.flush()
        self.scheduler.stop()
        if self._settling is not None:
            self._settling.cancel()
        self._interpreter.close()
        if any(robot.runner.leftover for robot in self.robots.values()):
            log.error("an adapter's run does not end: the watchdog ends this process if it never does")
        else:
            # To the watchdog a scheduler that has stopped is a loop that is stuck.
            self.watchdog.stop()
        self.supervised.close()

    async def close(self) -> None:
        """Close journal and history, once no stop can arrive that would have to be recorded."""
        await asyncio.to_thread(self.journal.close)
        await asyncio.to_thread(self.history.close)

    def stop_robots(self, names: tuple[str, ...], cause: StopCause) -> list[str]:
        """Emergency-stop robots at once, from any thread; no name means all of this process."""
        try:
            self.stop_requested(names, cause)
        except Exception:
            log.exception("a stop was not noted for the robots that join; those that run are stopped")
        stopped = [robot for robot in list(self.robots.values()) if not names or robot.name in names]
        for robot in stopped:
            robot.controller.latch.engage(cause.sentence)
        # A halt that blocks must not keep the next robot moving.
        call_sequentially(
            (partial(robot.controller.halt, emergency=True) for robot in stopped), wait=HALT_WAIT
        )
        call_sequentially((robot.controller.latch.record for robot in stopped), wait=HALT_WAIT)
        for robot in stopped:
            robot.requests.follow_emergency(cause)
        self.on_stop(names, cause)
        return [robot.name for robot in stopped]

    def follow_supervisor(self, stop: Callable[[bytes, StopCause], list[str]], ended: asyncio.Event) -> None:
        """Obey the supervisor's stops, and end when it dies; called before the robots start."""

        def end(why: str) -> None:
            log.error("%s: this process ends", why)
            self.loop.call_soon_threadsafe(ended.set)

        def stop_named(requested: StopRequest) -> list[str]:
            cause = local_cause(requested.by, requested.why, requested.request)
            return stop(msgspec.json.encode(requested.names), cause)

        self.supervised.begin(self.edge, self.worker, stop=stop_named, end=end)

    def halt_robots(self) -> None:
        """Halt all robots of this process at once, from any thread, without setting an emergency stop."""
        call_sequentially((robot.controller.halt for robot in list(self.robots.values())), wait=HALT_WAIT)

    def publish_state(self, name: str) -> None:
        """Publish a robot's state now."""
        publisher = self._states.wanted(keys.state(self.edge, name))
        if publisher is not None and name in self.robots:
            publisher.put(msgspec.json.encode(self.robots[name].state()))

    def _show(self, robot: LocalRobot) -> None:
        """Serve a robot on the bus: publish its state, take requests to it, watch its leases."""
        robot.be_watched(self.watchdog)
        relay_video(robot, self.edge, self.bus.reports, self.loop, self.clock, put=self.outbox.put_document)
        publish = partial(self.publish_state, robot.name)
        self._state_calls[robot.name] = self.scheduler.every(STATE_EVERY, publish)
        for service in (self._endpoints, *self.services):
            service.join(robot)

    def _look_at_processor(self) -> None:
        """Check whether this process gets enough processor time."""
        self.starvation.update(self.clock.monotonic(), self._thread.waited())

    def _running(self) -> str:
        """Return the robot that the loop is busy with; on the watchdog's thread."""
        return self.scheduler.owner or self._thread.owner()

    def _blocked(self, name: str, seconds: float) -> None:
        """Log and count a block of the loop, with its owner and place; on a watchdog thread."""
        where = self._thread.place()
        robot = self.robots.get(name)
        if robot is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just been closed
                self.loop.call_soon_threadsafe(robot.runner.blocked, where, seconds)
        log.error("%s blocks the event loop at %s", name, where)

    def _stuck(self, name: str) -> None:
        """Exit the process, whose robots are halted already; its supervisor restarts it."""
        text = f"the event loop is stuck in {name}: this process ends now"
        run_in_thread(partial(log_and_flush, log, text, within=FLUSH_TIMEOUT), wait=FLUSH_TIMEOUT)
        os._exit(70)
