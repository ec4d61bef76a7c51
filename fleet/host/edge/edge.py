"""Composition root: builds a running edge from the loaded fleet.yaml. Everything is built here alone."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fleet.bus import keys
from fleet.bus.bus import open_edge
from fleet.bus.zenoh_session import Query
from fleet.clock import Clock
from fleet.config.load import Loaded
from fleet.config.places import places_of
from fleet.health.aggregate import edge_health, robots_by_health
from fleet.health.load import read_load
from fleet.host.edge.bridge_to_cloud import bridge_of
from fleet.host.edge.certificate_expiry import CertificateExpiry, files_of
from fleet.host.edge.changes import ConfigurationChanges
from fleet.host.edge.cloud_claims import CloudClaims
from fleet.host.edge.cloud_presence import CloudPresence
from fleet.host.edge.drop_in_watch import DropInWatch, watched_files
from fleet.host.edge.membership import RobotRegistrations
from fleet.host.edge.metrics_port import MetricsPort
from fleet.host.edge.missions import Missions
from fleet.host.edge.notifier import Notifier
from fleet.host.edge.renamed_stops import carry_stops
from fleet.host.edge.schedules import EdgeSchedules
from fleet.host.edge.standby import open_gate, part_in_pair
from fleet.host.edge.summaries import Summaries
from fleet.host.edge.worker_members import WorkerMembership
from fleet.host.edge.worker_robots import RemoteRobots, Workers
from fleet.host.journal.stores import history_bounds, open_stores
from fleet.host.process.common_start import serve_common_starts
from fleet.host.process.component_settings import (
    bus_access,
    bus_settings,
    settle_time,
    settle_time_beside,
    worker_of,
)
from fleet.host.process.driverlog import publish_robot_logs
from fleet.host.process.history_service import HistoryService
from fleet.host.process.interrupted_commands import report_interrupted_commands
from fleet.host.process.robot_process import RobotProcess
from fleet.host.process.stop_inputs import TELL, StopInputs
from fleet.host.process.stop_service import serve_stops, stop_everywhere
from fleet.host.requests.stop_cause import local_cause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.robot_positions import positions_of
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_changes import WorkerChanges
from fleet.host.workers.worker_task import specs_here
from fleet.model.health import Health, degraded
from fleet.model.state import EdgeState, RobotState
from fleet.spool.state_folder import state_folder
from fleet.supervisor.client import SupervisorClient
from fleet.version import __version__

if TYPE_CHECKING:
    from fleet.host.edge.metrics import Metrics

log = logging.getLogger(__name__)

HEALTH_EVERY = 1.0  # s
HEARTBEAT_EVERY = 5.0  # s, contract 9.2
METRICS_EVERY = 5.0  # s between attempts to open the metrics port


class Edge:
    """One edge: its robots here and in workers, its bus, its bridge, its health.

    Raises BusError when the bus cannot be opened, CloudError for unusable cloud settings.
    """

    def __init__(
        self,
        loaded: Loaded,
        *,
        directory: Path,
        clock: Clock,
        supervised: SupervisorClient | None = None,
    ) -> None:
        config = loaded.config
        self._config = config
        self._clock = clock
        self._began = clock.monotonic()
        gate = open_gate(config)
        self.bus = open_edge(bus_settings(config, bus_access(config)), directory)
        with contextlib.ExitStack() as undo:
            undo.callback(self.bus.close)
            folder = state_folder(config.edge.id, config.edge.spool.path)
            journal, history = open_stores(
                config.edge.id, folder, history_bounds(config), directory, clock=clock
            )
            undo.callback(history.close)
            undo.callback(journal.close)
            self.process = RobotProcess(
                config.edge.id,
                self.bus,
                specs_here(loaded),
                journal=journal,
                history=history,
                clock=clock,
                settle=max(settle_time(config), settle_time_beside(config.edge.id, directory)),
                supervised=supervised,
                traffic=positions_of(config, clock),
                alone=not any(worker_of(*robot) for robot in loaded.robots),
            )
            self._remote_robots = RemoteRobots(loaded, self.process)
            self.remote = self._remote_robots.by_name
            self.process.claims.add(robot.twin for robot in self.remote.values())
            carry_stops(loaded, folder, self.process, self.remote)
            self.process.holders.moves_elsewhere = self._moves
            self.cloud_claims = CloudClaims(
                {robot.twin: robot for robot in self.robots()},
                hold=self.process.holders.set_cloud_holder,
                tell=partial(self.bus.control.put, keys.holders(config.edge.id)),
            )
            self._workers = Workers(loaded, directory, self.process, self.remote)
            self.missions = Missions(loaded, self.process, self.remote, folder, self._stop_robots)
            undo.callback(self.missions.close)
            self.bridge = bridge_of(
                config,
                {robot.twin: self.missions.plans.port(robot) for robot in self.robots()},
                put=self.bus.reports.put,
                alive=self._alive,
                claimed=self.cloud_claims.handle_claim,
                clock=clock,
                handlers=self.missions.workflows.handlers,
            )
            if self.bridge is not None:
                self.missions.workflows.publish = self.bridge.publisher.status
            self._presence = CloudPresence(self.bridge, self.process.supervised) if self.bridge else None
            if self._presence is not None:
                self.process.holders.changed = self._presence.set_holder
            self.metrics, self._metrics_port = self._make_metrics()
            undo.pop_all()
        self._groups = {name: list(robots) for name, robots in config.members.items()}
        self._stop_inputs = StopInputs(
            config.stop_inputs,
            self._groups,
            {name: robot.controller.latch for name, robot in self.process.robots.items()},
            self.remote,
            stop=self._stop_robots,
            renew=self._renew_stops,
            clock=clock,
        )
        self._expiry = CertificateExpiry(files_of(config), clock)
        self._recall = HistoryService(self.process.history)
        self._notifier = Notifier(config.notified, config.edge.id, clock)
        history = self.process.history
        self.schedules = EdgeSchedules(config, folder, self.missions.starter, self.process, self.states)
        history.on_event = self.schedules.event_receiver(self._notifier.handle)
        self._pair = part_in_pair(loaded, gate, self.process, self.schedules.run)
        self._watches: DropInWatch | None = None
        self._loaded = loaded
        self._worker_changes = workers = WorkerChanges(
            config.edge.id, self.bus.control, self._workers.managers, self.remote
        )
        self._changes = ConfigurationChanges(
            loaded,
            self.process,
            self.remote,
            workers,
            folder=folder,
            configured=(
                *self.missions.configured,
                self.schedules.configure,
                self._notifier.configure,
                self._pair.configure,
                self._configure,
            ),
            blocker=self.missions.blocker,
            members=WorkerMembership(self.process, self._remote_robots, self._workers, workers),
            groups=self._groups,
            followers=RobotRegistrations(
                self.missions,
                self._stop_inputs,
                self.cloud_claims,
                self._notifier,
                bridge=self.bridge,
                presence=self._presence,
                cloud=config.cloud,
            ),
        )
        self.summaries = Summaries(self, config.edge, clock)
        self.beside: Callable[[], str] = str  # problem of programs beside it, such as the console

    async def run(self, ended: asyncio.Event) -> None:
        """Serve until ``ended`` is set, then bring every robot to a standstill and close everything."""
        stop_logs = publish_robot_logs(self.process, self.remote)
        workers: list[asyncio.Task[None]] = []
        try:
            if self._metrics_port is not None:
                self._metrics_port.serve()
            self._declare(ended)
            cloud = self.bridge.publisher.publish_end if self.bridge else None
            report_interrupted_commands(self.process, self.robots(), cloud)
            self._pair.begin()
            self.process.start()
            self._stop_inputs.start(self.process.watchdog.add)
            if self.bridge is not None:
                self.process.scheduler.at_end(self.bridge.tick)
                self.bridge.start()
            self._workers.start()
            workers.append(asyncio.create_task(self._changes.begin(), name="changes"))
            if self._watches is not None:
                workers.append(asyncio.create_task(self._watches.run(), name="watch"))
            self.process.supervised.running()
            await ended.wait()
            self.process.supervised.ending()
        finally:
            for task in workers:
                task.cancel()
            self._workers.cancel()
            await self._changes.close()
            await asyncio.to_thread(self._stop_inputs.end)
            self._pair.ending()
            await self.process.stop()
            await self._pair.close()
            await asyncio.gather(*workers, return_exceptions=True)
            await self._workers.ended()
            if self.bridge is not None:
                for _ in self.bridge.tick():
                    pass
                await asyncio.to_thread(self.bridge.close)
            if self.metrics is not None:
                self.metrics.close()
            stop_logs()
            self.bus.close()
            await asyncio.to_thread(self._recall.close)
            await asyncio.to_thread(self.missions.close)
            await self.process.close()
            await asyncio.to_thread(self._notifier.close)

    def _make_metrics(self) -> tuple[Metrics | None, MetricsPort | None]:
        """Build the metrics server, if fleet.yaml has one."""
        if self._config.metrics is None:
            return None, None
        from fleet.host.edge.metrics import Metrics  # noqa: PLC0415 - only where it is configured

        metrics = Metrics(self)
        return metrics, MetricsPort(metrics, self._config.metrics)

    def watch_drop_ins(self) -> None:
        """Reload drop-in files whenever they are saved; before ``run``."""
        workers = self._worker_changes

        async def request(worker: str, adapter: str, force: bool) -> str:  # noqa: FBT001 - by position
            return await workers.start_again(worker, adapter, force=force)

        self._watches = DropInWatch(watched_files(self._loaded), request, workers.blocker)

    def robots(self) -> list[LocalRobot | RemoteRobot]:
        """Return every robot of this edge, also those in its workers."""
        return [*self.process.robots.values(), *self.remote.values()]

    def states(self) -> list[RobotState]:
        """Return the state of every robot of this edge."""
        return [robot.state() for robot in self.robots()]

    def state(self) -> EdgeState:
        """Return the edge's own state: summary of its robots, its bus, its cloud, its host."""
        states, services = self.states(), self.services()
        health, cloud = edge_health(states, services), services[0]
        load, bridge = read_load(), self.bridge
        stats = bridge.client.stats if bridge else None
        return EdgeState(
            edge=self._config.edge.id,
            version=__version__,
            stamp=self._clock.time(),
            uptime=round(self._clock.monotonic() - self._began, 1),
            health=health.level.word,
            cause=health.cause,
            robots=robots_by_health(states),
            bus="alone" if self.bus.problem else "ok",
            cloud=self.bridge.client.state.value if self.bridge else "none",
            cloud_cause=cloud.cause,
            queued=stats.queued if stats else 0,
            queued_bytes=stats.queued_bytes if stats else 0,
            spooled=bridge.client.spool.waiting if bridge else 0,
            unheard=bridge.client.spool.unsubscribed if bridge else 0,
            waiting=bridge.uplink.waiting if bridge else 0,
            refused=bridge.refusals.total if bridge else 0,
            round_trip=bridge.round_trip.seconds if bridge else None,
            dropped=self._dropped(),
            load=load.load,
            memory_percent=load.memory_percent,
            threads=load.threads,
            groups=self._groups,
            places=places_of(self._config.places),
            pair=self._pair.role,
            epoch=self._pair.epoch,
            pair_file=self._pair.file,
            problems=[each.cause for each in services[1:] if each.cause],
        )

    def services(self) -> list[Health]:
        """Return the health of the edge's own services, the cloud first."""
        cloud = self.bridge.health if self.bridge else Health()
        kept = (self.process.journal.problem, self.process.history.problem, self.missions.problem)
        metrics = self._metrics_port.problem if self._metrics_port else ""
        claims, expiry = self.cloud_claims.problem, self._expiry.problem
        busy, bus = self.process.starvation.problem, (self.bus.problem, self.bus.removed)
        inputs, schedules = self._stop_inputs.problem, self.schedules.problem
        problems = (*bus, *kept, schedules, inputs, metrics, expiry, claims, busy)
        return [cloud, *map(degraded, (*problems, self._pair.problem, self.beside()))]

    def _dropped(self) -> int:
        """Return how many outgoing messages were lost, at the robots, the bridge or the cloud."""
        bridge = self.bridge
        return self.process.outbox.dropped + (
            bridge.uplink.dropped.total + bridge.client.stats.dropped if bridge else 0
        )

    def _configure(self, loaded: Loaded) -> None:
        """Use another configuration from now on."""
        self._config = loaded.config

    def _soon(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop; from any thread."""
        self.process.loop.call_soon_threadsafe(call)

    def _declare(self, ended: asyncio.Event) -> None:
        """Show the edge on the bus, and start its periodic reports."""
        edge = self._config.edge.id
        stop = serve_stops(self.process, self.bus, self._groups, self.remote.values())
        serve_common_starts(self.process)
        self.process.follow_supervisor(stop, ended)
        if self._presence is not None:
            self._presence.register_disconnect_messages()
        if self.bridge is not None:
            self.process.outbox.bridge = self.bridge.uplink
            self.bridge.uplink.refuse_bus_events(robot.twin for robot in self.process.robots.values())
            self.bus.reports.subscribe_batches("cw/*/data/**", self.bridge.handle_samples)
            self.bridge.streams.listen(self.bus.reports.subscribe)
        self.bus.control.declare_queryable(keys.health(edge), self._requested_health)
        self.bus.control.declare_queryable(keys.history(edge), self._recall.requested)
        self.bus.control.declare_queryable(
            keys.schedules(edge), self.schedules.requested, more=keys.SENDER_SUFFIX
        )
        self.missions.declare()
        self._changes.declare(self.bus.control)
        self._notifier.subscribe(self.bus.reports, {robot.twin: robot.name for robot in self.remote.values()})
        health = self.bus.control.publisher(keys.health(edge))

        def report_health() -> None:
            if health.wanted:
                health.put(msgspec.json.encode(self.state()))

        self.process.scheduler.every(HEALTH_EVERY, report_health)
        self.summaries.declare(self.bus.control, self.process.scheduler, self._soon)
        if self.bridge is not None:  # repeatedly: a worker may have been restarted
            self.process.scheduler.every(HEALTH_EVERY, self.cloud_claims.notify_workers)
        if self._config.stop_inputs:
            held = self.bus.control.publisher(keys.held(edge))
            self.process.scheduler.every(TELL, lambda: held.put(self._stop_inputs.held))
        if self.bridge is not None:
            self.process.scheduler.every(HEARTBEAT_EVERY, self._beat)
        if self._metrics_port is not None:
            self.process.scheduler.every(METRICS_EVERY, self._metrics_port.serve)
        self.bus.control.token(keys.edge(edge))

    def _moves(self, twin: str) -> bool:
        """Return True while a worker's robot of this twin is active."""
        return any(bool(robot.state().activity) for robot in self.remote.values() if robot.twin == twin)

    def _beat(self) -> None:
        """Publish every twin's heartbeat, and the edge's own."""
        assert self._presence is not None
        self._presence.beat(self.state(), self.states())

    def _requested_health(self, question: Query) -> None:
        """Answer with the edge's state; on the bus's thread."""
        self._soon(lambda: question.answer(msgspec.json.encode(self.state())))

    def _alive(self, name: str) -> bool:
        """Return True while a robot is reachable."""
        robot = self.process.robots.get(name) or self.remote.get(name)
        return robot is not None and robot.state().reachable

    def _stop_robots(self, names: tuple[str, ...], why: str) -> None:
        """Set the emergency stop of robots, here and in workers; no name means all. From any thread."""
        stop_everywhere(self.process, self.remote.values(), names, local_cause("", why))

    def _renew_stops(self, names: tuple[str, ...], why: str) -> None:
        """Set the stop again for robots in workers that do not have it; from any thread."""
        for robot in list(self.remote.values()):
            if not names or robot.name in names:
                robot.renew_stop(local_cause("", why))
