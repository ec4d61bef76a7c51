"""Adds robots in workers to a running edge and removes them, each completely or not at all.

A robot with a worker of its own comes and goes with that process. A worker with other robots restarts with or
without it, once they are at rest.
"""

from __future__ import annotations

from collections.abc import Callable

from fleet.config.load import Loaded
from fleet.config.loaded_robots import with_robot, without_robot
from fleet.host.edge.worker_robots import RemoteRobots, Workers
from fleet.host.process.component_settings import worker_of
from fleet.host.process.rebuild import wait_until
from fleet.host.process.robot_process import RobotProcess
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_changes import WorkerChanges
from fleet.host.workers.worker_manager import START_WITHIN
from fleet.model.change import Outcome

TAKEN = frozenset({Outcome.DONE, Outcome.PARTLY})  # the worker runs with it


class WorkerMembership:
    """Robots of one edge in workers; on the loop. ``add`` and ``remove`` return why they failed."""

    def __init__(
        self, process: RobotProcess, remote: RemoteRobots, workers: Workers, changes: WorkerChanges
    ) -> None:
        self._process, self._remote, self._workers, self._changes = process, remote, workers, changes

    def robot(self, name: str) -> RemoteRobot | None:
        """Return a robot that runs in a worker."""
        return self._remote.by_name.get(name)

    def blocker(self, name: str) -> str:
        """Return why a robot cannot be removed from its worker now, as far as the edge knows."""
        return self._changes.blocker(self._remote.by_name[name].worker)

    async def add(self, name: str, running: Loaded, new: Loaded, join: Callable[[RemoteRobot], None]) -> str:
        """Add a robot of a new file; ``join`` adds it to the rest of the edge before it is run."""
        config, plugin = next((robot, plugin) for robot, plugin in new.robots if robot.name == name)
        try:
            robot = self._remote.add(config, plugin)
            if self._process.traffic is not None:
                self._process.traffic.expect(name)
            join(robot)
            self._process.claims.begin(robot.twin)
            return await self._started(robot, worker_of(config, plugin), with_robot(running, new, name))
        except Exception as error:  # noqa: BLE001 - the caller undoes everything
            return f"{type(error).__name__}: {error}"

    async def remove(self, name: str, running: Loaded, *, force: bool) -> str:
        """Remove a robot, which then stands still. Call ``forget`` afterwards."""
        robot = self._remote.by_name[name]
        if all(each is robot or each.worker != robot.worker for each in self._remote.by_name.values()):
            if robot.worker in self._workers.managers:
                await self._workers.end(robot.worker)
                return ""
            return f"worker {robot.worker} was started by hand: end it first"
        after = without_robot(running, name)
        outcome, why = await self._changes.change(robot.worker, after, force=force, gone=name)
        return "" if outcome in TAKEN else why

    def forget(self, robot: RemoteRobot) -> None:
        """Remove a robot that no worker runs any more."""
        self._remote.remove(robot)
        self._process.outbox.drop(robot.twin)
        self._process.holders.give_up(robot.twin)
        if self._process.traffic is not None:
            self._process.traffic.leave(robot.name)

    async def _started(self, robot: RemoteRobot, worker: str, after: Loaded) -> str:
        """Run a robot in its worker; return why it does not run."""
        if worker in after.config.remote_workers:
            return f"worker {worker} is started by hand: end it, and start it with the new file"
        if worker in self._workers.managers:
            outcome, why = await self._changes.change(worker, after, force=False)
            return "" if outcome in TAKEN else why
        manager = self._workers.add(worker, after)
        # Until its first state the worker counts as silent, and changes after this one would be refused.
        if await wait_until(lambda: manager.started > 0 and not robot.silent, START_WITHIN):
            return ""
        await self._workers.end(worker)
        return robot.state().cause or f"worker {worker} did not come up within {START_WITHIN:g} s"
