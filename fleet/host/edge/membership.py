"""Adds robots to a running edge and removes them, each completely or not at all.

Several parts of an edge know its robots: missions, the bridge to the cloud, claims, stop inputs.
``Membership`` informs all of them, and undoes a change in which one of them fails.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial

import msgspec

from fleet.bridge.bridge import Bridge
from fleet.config.load import Loaded
from fleet.config.schema import CloudConfig
from fleet.host.edge.cloud_claims import CloudClaims
from fleet.host.edge.cloud_presence import CloudPresence
from fleet.host.edge.member_rules import runs_in
from fleet.host.edge.missions import Missions
from fleet.host.edge.notifier import Notifier
from fleet.host.edge.stops_during_change import StopsDuringChange
from fleet.host.edge.worker_members import WorkerMembership
from fleet.host.process.component_settings import bridge_rules
from fleet.host.process.rebuild import end_run, wait_until
from fleet.host.process.robot_process import RobotProcess, RobotSpec
from fleet.host.process.stop_inputs import StopInputs
from fleet.host.requests.stop_cause import local_cause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.rest_check import moving, not_resting
from fleet.host.safety.admission import LEAVE
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_task import Importer, robot_tasks
from fleet.missions.observed import SHOWN_WITHIN
from fleet.model.command import Transport

log = logging.getLogger(__name__)

LEAVES_WITHIN = SHOWN_WITHIN + 3.0  # s for runs to release a robot; one it has just joined waits so long


class RobotRegistrations:
    """All parts of one edge that hold data per robot; on the event loop."""

    def __init__(
        self,
        missions: Missions,
        stop_inputs: StopInputs,
        cloud_claims: CloudClaims,
        notifier: Notifier,
        *,
        bridge: Bridge | None,
        presence: CloudPresence | None,
        cloud: CloudConfig | None,
    ) -> None:
        self._missions, self._stop_inputs, self._cloud_claims = missions, stop_inputs, cloud_claims
        self._notifier = notifier
        self._bridge, self._presence, self._cloud = bridge, presence, cloud

    def join(self, robot: LocalRobot | RemoteRobot) -> None:
        """Add a robot; before it is run."""
        if isinstance(robot, LocalRobot):
            self._stop_inputs.join(robot.name, robot.controller.latch)
        else:
            self._notifier.join(robot.name, robot.twin)
        self._missions.join(robot)
        self._cloud_claims.join(robot.twin, robot)
        if self._bridge is not None and self._presence is not None and self._cloud is not None:
            rules = bridge_rules(self._cloud, [robot.config]).twins[robot.twin]
            self._bridge.join(self._missions.plans.port(robot), rules)
            self._bridge.uplink.refuse_bus_events([robot.twin] if isinstance(robot, LocalRobot) else [])
            self._presence.register_disconnect_messages()

    def leave(self, robot: LocalRobot | RemoteRobot) -> None:
        """Remove a robot whose run has ended; a failure of one part does not stop the others."""
        name, twin = robot.name, robot.twin
        parts: list[Callable[[], None]] = [partial(self._missions.leave, name)]
        parts += [partial(part.leave, twin) for part in (self._notifier, self._cloud_claims)]
        if self._bridge is not None and self._presence is not None:
            parts += [partial(self._bridge.leave, twin), self._presence.register_disconnect_messages]
        leave_all(name, partial(self._stop_inputs.leave, name), *parts)

    def runs_with(self, robot: str) -> list[str]:
        """Return the runs of missions that a robot is in."""
        return [run.id for run in self._missions.runs.all() if run.engine.robots.needs(robot)]


class Membership:
    """Robots of one edge; on the event loop.

    All methods return why nothing was changed, empty on success. The stops recorded by ``stops`` are set
    in each new robot before anything can move it.
    """

    def __init__(
        self,
        process: RobotProcess,
        followers: RobotRegistrations,
        stops: StopsDuringChange,
        workers: WorkerMembership,
    ) -> None:
        self._process, self._registrations, self._stops = process, followers, stops
        self._workers = workers
        self._taken_out: dict[str, str] = {}  # twin to name of robots removed earlier

    def blocker(self, name: str) -> str:
        """Return why a robot of the edge cannot be removed now; empty when it is at rest."""
        here = self._process.robots.get(name)
        return not_resting(here) if here is not None else self._workers.blocker(name)

    async def add(self, name: str, running: Loaded, loaded: Loaded) -> str:
        """Add a robot of a loaded file to the running ones."""
        if runs_in(loaded, name):
            return await self._added_to_worker(name, running, loaded)
        try:
            robot = await self._built(name, loaded)
        except Exception as error:  # its adapter is foreign code
            log.exception("%s cannot be added", name)
            return f"it cannot be built: {type(error).__name__}: {error}"
        if why := await self._stop_before(name, robot.twin):
            robot.controller.latch.engage(why)
            robot.controller.latch.record()
        self._stops.engage(robot)
        try:
            self._registrations.join(robot)
            self._process.serve(robot)
        except Exception as error:
            log.exception("%s cannot be added", name)
            self._released(robot)
            return f"it cannot be added: {type(error).__name__}: {error}"
        return ""

    async def _added_to_worker(self, name: str, running: Loaded, loaded: Loaded) -> str:
        """Add a robot that runs in a worker."""
        twin = next(str(config.twin) for config, _ in loaded.robots if config.name == name)
        why = await self._stop_before(name, twin)

        def join(robot: RemoteRobot) -> None:
            if why:
                robot.stop_later(local_cause("", why))
            self._stops.pass_on(robot)
            self._registrations.join(robot)

        trouble = await self._workers.add(name, running, loaded, join)
        robot = self._workers.robot(name)
        if trouble and robot is not None:
            self._released_from_worker(robot)
        elif robot is not None:
            self._stops.pass_on(robot)
        return trouble

    async def _stop_before(self, name: str, twin: str) -> str:
        """Return the stop of a removed robot that comes back under another name; else empty."""
        before = self._taken_out.get(twin, name)
        if before == name:
            return ""
        why = (await asyncio.to_thread(self._process.journal.robot, before)).latched
        if why:
            log.warning("%s was %s: its emergency stop is still set: %s", name, before, why)
        return why

    async def remove(self, name: str, running: Loaded, *, force: bool) -> str:
        """Bring a robot to a standstill and remove it."""
        remote = self._workers.robot(name)
        if remote is not None:
            return await self._removed_from_worker(remote, running, force=force)
        robot = self._process.robots[name]
        trouble = await self.remove_from_runs(robot) or await end_run(self._process, robot)
        if trouble:  # not run again: two adapters would move one robot
            return trouble
        if robot.controller.motion.may_be_moving:
            self._process.runs.resume(robot)
            return moving(robot)
        self._released(robot)
        return ""

    async def _removed_from_worker(self, robot: RemoteRobot, running: Loaded, *, force: bool) -> str:
        """Remove a robot from its worker."""
        trouble = await self.remove_from_runs(robot)
        trouble = trouble or await self._workers.remove(robot.name, running, force=force)
        if trouble:
            self._stops.pass_on(robot)
        else:
            self._released_from_worker(robot)
            await self._keep_stop(robot)
        return trouble

    async def _keep_stop(self, robot: RemoteRobot) -> None:
        """Record the stop of a removed robot, if its worker has not confirmed it."""
        self._stops.pass_on(robot)
        if robot.unconfirmed_stop:
            journal = await asyncio.to_thread(self._process.journal.robot, robot.name)
            journal.latch(robot.unconfirmed_stop)

    async def _built(self, name: str, loaded: Loaded) -> LocalRobot:
        """Build a robot of a loaded file; raises the errors of its adapter."""
        spec = await asyncio.to_thread(_spec_of, loaded, name)
        journal = await asyncio.to_thread(self._process.journal.robot, name)
        try:
            return self._process.add(spec, journal)
        except Exception:
            if left := self._process.robots.get(name):
                self._process.drop(left)
            raise

    def _released(self, robot: LocalRobot) -> None:
        """Remove a robot everywhere; its stop is kept under its name, found by its twin."""
        self._taken_out[robot.twin] = robot.name
        drop, give_up = partial(self._process.drop, robot), partial(self._process.holders.give_up, robot.twin)
        leave_all(robot.name, partial(self._registrations.leave, robot), drop, give_up)

    def _released_from_worker(self, robot: RemoteRobot) -> None:
        """Remove a robot of a worker everywhere, like one of the edge's process."""
        self._taken_out[robot.twin] = robot.name
        leave_all(robot.name, partial(self._registrations.leave, robot), partial(self._workers.forget, robot))

    async def remove_from_runs(self, robot: LocalRobot | RemoteRobot) -> str:
        """Take a robot out of the runs of missions; return which do not release it."""
        for run in self._registrations.runs_with(robot.name):
            message = {"command": LEAVE, "data": {"run": run}, "session_id": "fleet apply"}
            request = robot.read("command", msgspec.json.encode(message), transport=Transport.MISSION)
            if request is not None:
                request(lambda _reply: None)
        if await wait_until(lambda: not self._registrations.runs_with(robot.name), LEAVES_WITHIN):
            return ""
        runs = ", ".join(self._registrations.runs_with(robot.name))
        return f"run {runs} still uses this robot: abort the run first"


def leave_all(name: str, *parts: Callable[[], None]) -> None:
    """Remove a robot that is no longer run from every part; a failure of one does not stop the others."""
    for part in parts:
        try:
            part()
        except Exception:
            log.exception("a part of %s is left behind until the edge is started again", name)


def _spec_of(loaded: Loaded, name: str) -> RobotSpec:
    """Return the spec of a robot in the edge's process, with its adapter imported; blocks."""
    task = next(task for task in robot_tasks(loaded, "") if task.name == name)
    return Importer(loaded.folder, loaded.registry).spec(task)
