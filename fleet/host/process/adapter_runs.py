"""Decides which robots of a process run: those whose twins are ours, except while one is reconfigured."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable

from fleet.host.robot.local_robot import LocalRobot

log = logging.getLogger(__name__)

CHANGES = "its configuration changes"


class AdapterRuns:
    """Runs of the robots of one process. ``again`` is called for a robot that may run again."""

    def __init__(self, again: Callable[[LocalRobot], None]) -> None:
        self.tasks: dict[str, asyncio.Task[None]] = {}
        self.ending = False
        self._again = again
        self._paused: set[str] = set()
        self._barred = ""  # why no robot runs at all

    def run(self, robot: LocalRobot) -> None:
        """Run a robot, once its earlier run has ended."""
        task = self.tasks.get(robot.name)
        if self._barred:
            self.suspend(robot, self._barred)
        if self._barred or self.ending or robot.name in self._paused:
            return
        if task is None:
            self.tasks[robot.name] = robot.start()
        elif task.cancelling():
            task.add_done_callback(lambda _: self._again(robot))

    def suspend(self, robot: LocalRobot, why: str) -> None:
        """End a robot's run, if there is one, and set the reason."""
        task = self.tasks.get(robot.name)

        def ended(_task: asyncio.Task[None]) -> None:
            self.tasks.pop(robot.name, None)
            robot.stand_by(why)

        if task is None:
            robot.stand_by(why)
        elif not task.cancelling():
            task.add_done_callback(ended)
            task.cancel()

    def suspend_all(self, robots: Iterable[LocalRobot], why: str) -> None:
        """End all runs, and start none until ``resume_all``."""
        self._barred = why
        for robot in robots:
            self.suspend(robot, why)

    def resume_all(self, robots: Iterable[LocalRobot]) -> None:
        """Run the robots again whose twins are ours."""
        self._barred = ""
        for robot in robots:
            self._again(robot)

    async def all_ended(self, robots: Iterable[LocalRobot]) -> None:
        """Wait until no robot runs, including runs that ignore their cancellation."""
        while running := [task for task in self.tasks.values() if not task.done()]:
            await asyncio.wait(running)
            await asyncio.sleep(0)  # let the done callbacks remove the ended runs from the table
        leftovers = {robot.name: left for robot in robots if (left := robot.runner.leftover) is not None}
        if leftovers:
            log.error("the adapters of %s do not end; they may still control them", ", ".join(leftovers))
            await asyncio.wait(leftovers.values())

    def pause(self, robot: LocalRobot) -> None:
        """End a robot's run until ``resume``; a prepared start is dropped."""
        self._paused.add(robot.name)
        robot.controller.event_reporter.heard(CHANGES)
        self.suspend(robot, CHANGES)

    def is_paused(self, robot: LocalRobot) -> bool:
        """Return True once the run has ended."""
        return robot.name in self._paused and robot.name not in self.tasks

    def forget(self, robot: LocalRobot) -> None:
        """Remove a robot whose run has ended."""
        self._paused.discard(robot.name)
        self.tasks.pop(robot.name, None)

    def resume(self, robot: LocalRobot) -> None:
        """Start its run again, unless another edge has its twin by now."""
        self._paused.discard(robot.name)
        self._again(robot)
