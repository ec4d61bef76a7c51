"""One robot of this process: its controller, adapter runner, reports and state, wired together."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable
from functools import partial

import msgspec

from fleet.clock import Clock
from fleet.commands import CommandSpec
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.history_recorder import HistoryRecorder, never_raises
from fleet.host.requests.unrequested_events import UnrequestedEvents
from fleet.host.robot.adapter_factory import AdapterClass, capabilities, configured, create_adapter
from fleet.host.robot.adapter_runner import AdapterRunner
from fleet.host.robot.command_descriptions import description
from fleet.host.robot.controller import RobotController
from fleet.host.robot.dry_run import would_refuse
from fleet.host.robot.joint_control import STEP
from fleet.host.robot.report_queue import ReportQueue
from fleet.host.robot.request_intake import RequestIntake
from fleet.host.robot.robot_handle import RobotHandle
from fleet.host.robot.robot_positions import RobotPositions
from fleet.host.robot.separation_keeper import POLL_INTERVAL
from fleet.host.robot.separation_wiring import keeper_of
from fleet.host.robot.snapshot import READ, Snapshot, is_known, rounded
from fleet.host.runtime.blocking_calls import BlockingCalls
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.host.runtime.watchdog import Watchdog, WatchedRobot
from fleet.link.backoff import backoff
from fleet.model.command import Reply
from fleet.model.description import RobotDescription
from fleet.model.event import EventReport
from fleet.model.health import Health, Level
from fleet.model.report import JointReport, MetricsReport, NavigationReport, Report, TelemetryReport
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig
from fleet.runtime.event_loop import OWNER
from fleet.supervisor.client import SupervisorClient

RECORD_EVERY = 1.0  # s between records of the end of motion


class LocalRobot:
    """A robot whose adapter runs in this process."""

    def __init__(
        self,
        config: AdapterConfig,
        plugin: AdapterClass,
        *,
        adapter: str,
        edge: str,
        worker: str,
        clock: Clock,
        scheduler: TickScheduler,
        shared: SharedResources,
        outbox: ReportQueue,
        journal: RobotJournal,
        record: Callable[[EventReport], None],
        arrival: Callable[[], float],
        changed: Callable[[str], None],
        supervised: SupervisorClient,
        drop_in: str = "",
    ) -> None:
        self.config = config
        self._drop_in = drop_in
        self.name, self.twin = config.name, str(config.twin)
        self.source_type, self.legacy_status = config.source_type, config.legacy_status
        self._simulated = config.simulated  # cached: the state is built often
        self._edge, self._worker = edge, worker
        self.clock, self._scheduler = clock, scheduler
        self._send = outbox.sender(self.twin)
        self._seen = Snapshot()
        self._traffic: RobotPositions | None = None
        self._loop = asyncio.get_running_loop()
        self._context = contextvars.copy_context()
        self._context.run(OWNER.set, config.name)
        self._online = False
        self._adapter = adapter
        self._record = never_raises(record)  # into the edge's history
        self._recorder = HistoryRecorder(self.publish, clock)
        self.plugin, can = plugin, configured(capabilities(plugin), config)
        self.controller = RobotController(
            config,
            can,
            publish=self.publish,
            crashed=lambda error: self.runner.crashed(error),  # noqa: PLW0108 - it is made below
            restart=lambda: self.runner.restart(),  # noqa: PLW0108 - it is made below
            journal=journal,
            clock=clock,
        )
        scheduler.every(
            RECORD_EVERY,
            self.controller.motion.record,
            owner=config.name,
            failed=lambda error: self.runner.crashed(error),  # noqa: PLW0108 - it is made below
        )
        self.unrequested_events = UnrequestedEvents(self.controller.event_reporter)
        self.requests = RequestIntake(
            config,
            self.controller,
            clock=clock,
            publish=self.publish,
            changed=changed,
            recorder=self._recorder,
            arrival=arrival,
            home_altitude=lambda: self._seen.home_altitude,
            context=self._context,
        )
        self.read = self.requests.read
        self._changed = changed
        self._limits = config.limits.over(can.limits)
        self._make_handle = partial(
            RobotHandle,
            self.name,
            state={},  # kept over restarts of the adapter, like the blocking calls
            calls=BlockingCalls(config.name),
            clock=clock,
            scheduler=scheduler,
            shared=shared,
            supervised=supervised,
        )
        self.runner = AdapterRunner(
            self.controller,
            make=lambda handle: create_adapter(plugin, self.config, handle),
            handle=self._new_handle,
            waits=backoff,
            clock=clock,
            changed=self._health_changed,
            level_changed=self.unrequested_events.report_level,
        )

    def configure(self, config: AdapterConfig) -> None:
        """Apply another configuration of the robot: at once here, in the adapter at its next start."""
        can = configured(capabilities(self.plugin), config)
        can = msgspec.structs.replace(can, lacking=self.controller.can.lacking)
        self.controller.can, self.config, self._limits = can, config, config.limits.over(can.limits)
        self.requests.configure(config)
        for part in self.controller.configured:
            part.configure(config, self._limits)

    def share_space(self, traffic: RobotPositions) -> None:
        """Keep the robot apart from the other robots of the edge."""
        guard = self.controller.guard
        self._traffic = traffic
        apart = keeper_of(self.config, self._limits, self.controller, traffic, self.clock)
        traffic.join(apart)
        guard.share_space(apart)

        def on_failure(error: Exception) -> None:
            self.runner.crashed(error)
            self._scheduler.every(POLL_INTERVAL, apart.check, owner=self.name, failed=on_failure)

        self._scheduler.every(POLL_INTERVAL, apart.check, owner=self.name, failed=on_failure)

    def spec_of(self, command: str) -> CommandSpec | None:
        """Return the adapter's declaration of a command, None for an unknown one."""
        return self.controller.can.command(command)

    @property
    def in_use(self) -> bool:
        """True from the first motion through this edge until another edge takes the robot."""
        return self.requests.in_use

    def start(self) -> asyncio.Task[None]:
        """Start to run the robot."""
        self.controller.statuses.recall()
        return self._loop.create_task(self.runner.run(), name=f"robot:{self.name}", context=self._context)

    def stand_by(self, why: str) -> None:
        """Note that the robot is not run, with the cause, such as another edge that has it."""
        self.requests.in_use = False
        self.runner.stand_by(why)

    def be_watched(self, watchdog: Watchdog) -> None:
        """Have the watchdog end velocities and joint targets whose lease has expired."""

        def expired() -> None:
            self._loop.call_soon_threadsafe(self._lease_ran_out)

        watchdog.add(self.name, WatchedRobot(self.controller.deadman, self.controller.halt, expired))
        joints = self.controller.joints
        if self.controller.can.moves_joints:
            watchdog.add(
                f"{self.name} joints", WatchedRobot(joints.deadman, joints.hold, self._joints_expired)
            )
            self._scheduler.every(STEP, joints.step, owner=self.name, failed=self.runner.crashed)

    def follow(self, report: JointReport) -> None:
        """Follow the leader's joint positions, once ``follow_leader`` was commanded; on the loop."""
        request = self.controller.joints.following(report)
        if request is not None:
            self.requests.submit("joints", request, False, self.clock.monotonic(), self._leader_answered)

    def _leader_answered(self, reply: Reply) -> None:
        """Process the answer to the leader's targets, which has no other receiver."""
        self.controller.joints.followed(reply)
        self.requests.log_refusal(reply)

    def publish(self, report: Report) -> None:
        """Send a report to the bus; events are recorded in the edge's history too."""
        if isinstance(report, EventReport):
            self._record(report)
        if type(report) in READ and is_known(report):
            self._seen.update(report)
            self.unrequested_events.observe(report)
            self.controller.observe(report)
            self.controller.guard.observe(report)
        elif type(report) is NavigationReport:
            self._seen.update(report)
        elif type(report) is JointReport:
            self.controller.joints.observe(report)
        elif type(report) is MetricsReport:
            report = self._seen.with_remaining_distance(report)
        self._send(report)

    def _reported(self, report: Report) -> None:
        """Publish a report of the adapter, and note its time."""
        self._seen.heard = self.clock.monotonic()
        self.publish(report)

    def state(self) -> RobotState:
        """Return the state of the robot now."""
        health = self._health()
        placed = self._traffic.in_site(self.name) if self._traffic else None
        return RobotState(
            name=self.name,
            twin=self.twin,
            adapter=self._adapter,
            edge=self._edge,
            stamp=self.clock.time(),
            health=health.level.word,
            cause=health.cause,
            reachable=not self.controller.offline,
            simulated=self._simulated,
            worker=self._worker,
            mode=self._seen.mode,
            armed=self._seen.armed,
            battery=self._seen.battery,
            position=self._seen.position,
            activity=self.controller.activity,
            emergency_stop=self.controller.latched,
            stop_cause=self.controller.latch.cause,
            last_command=self.controller.last.command,
            last_outcome=self.controller.last.outcome,
            senders=self.controller.senders(),
            site=placed.at if placed else None,
            placement=placed.placement if placed else None,
            separation=self._traffic.unknown(self.name) if self._traffic else "",
            in_use=self.in_use,
            drop_in=self._drop_in,
            speed=rounded(self._seen.speed(self.clock.time())),
            age=rounded(self._seen.age(self.clock.monotonic())),
            run=self.controller.lease.run,
            left_run=self.controller.lease.left,
            heading=rounded(self._seen.heading),
            control=self.controller.lease.holder(self.clock.monotonic()),
        )

    def describe(self) -> RobotDescription:
        """Describe the commands of the robot, and whether it would take them now."""
        return description(
            self.name,
            self._adapter,
            self.controller.can.on(self._seen.autopilot, self._seen.vehicle),
            own=self.controller.own,
            limits=self._limits,
            fence=self.controller.guard.fencing.fence,
            refusal=partial(would_refuse, self.controller),
            posed=self.controller.goals.follower.has_pose,
        )

    def _health(self) -> Health:
        """Return the health; degraded after an action forced by the battery or by another robot."""
        health, cause = self.runner.health, self.controller.guard.cause
        return Health(Level.DEGRADED, cause) if cause and health.level is Level.OK else health

    def _new_handle(self, runner: AdapterRunner) -> RobotHandle:
        """Return the handle for a new run of the adapter."""
        return self._make_handle(
            limits=self._limits,
            publish=self._reported,
            healthy=runner.healthy,
            lost_authority=self.controller.authority_lost,
            latched=lambda: self.controller.latched,
            lacking=self.controller.can.lacking,
            circled=self.controller.guard.circles,
            failed=runner.crashed,
        )

    def _joints_expired(self) -> None:
        """Log and record that the watchdog stopped the joints."""
        self._loop.call_soon_threadsafe(self._recorder.lease_ran_out)
        self.controller.event_reporter.log.warning(
            "no joint target within its lease: the joints hold where they are"
        )

    def _lease_ran_out(self) -> None:
        """Record that the watchdog halted the robot, and stop it through the adapter."""
        self._recorder.lease_ran_out()
        self.controller.motion.lease_ran_out()

    def _health_changed(self) -> None:
        """Publish on the telemetry channel when the robot connects and disconnects, in the SDK's order."""
        online = not self.controller.offline
        if online != self._online:
            self._online = online
            kind, session = ("connected", "telemetry_start") if online else ("disconnected", "telemetry_end")
            fields = {} if online else {"reason": self.runner.health.cause}
            self.publish(TelemetryReport(now := self.clock.time(), kind, fields))
            self.publish(TelemetryReport(now, session))
        self._changed(self.name)
