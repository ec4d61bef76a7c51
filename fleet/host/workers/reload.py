"""Reloads a worker on request, after a change of its drop-in file or configuration: it ends and is restarted.

Python cannot unload a module that is in use, so the whole process is replaced. It goes on with the old file
while one of its robots moves or is commanded, and if the new file is unusable.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.rest_check import not_resting
from fleet.host.workers.worker_task import RobotTask, WorkerTask
from fleet.model.command import Reply, ReplyStatus
from fleet.plugins.drop_in_file import insecure
from fleet.plugins.probe import ConfigCase, Probe, ProbeError, ProblemPlace

log = logging.getLogger(__name__)

RELOADED = 75  # exit code of a worker that is to be restarted at once
NAME = "reload"
_LONGEST_NAME = 200  # bytes


class Reload:
    """Serves reload requests of one worker; ``end`` ends it in order.

    ``started_by_hand``: nothing would restart it.
    """

    def __init__(
        self,
        task: WorkerTask,
        robots: Callable[[], Iterable[LocalRobot]],
        *,
        end: Callable[[], None],
        started_by_hand: bool,
    ) -> None:
        self.reloaded = False
        self._task = task
        self._robots = robots
        self._end = end
        self._by_hand = started_by_hand
        self._loop = asyncio.get_running_loop()
        self._under_way: asyncio.Task[None] | None = None

    def requested(self, question: Query) -> None:
        """Receive a request: an adapter's name, or empty for another configuration; from any thread."""
        self._loop.call_soon_threadsafe(self._begin, question)

    def _begin(self, question: Query) -> None:
        if self._under_way is not None and not self._under_way.done():
            _answer(question, "a reload is under way already")
        else:
            self._under_way = asyncio.create_task(self._carry_out(question))

    async def _carry_out(self, question: Query) -> None:
        """Answer a request, and end the worker if nothing prevents it."""
        name = question.payload[:_LONGEST_NAME].decode("utf-8", "replace")
        forced = question.parameters.get("force") == "1"
        try:
            refusal = await (self.refusal(name, forced=forced) if name else self.blocker(forced=forced))
        except Exception as error:  # a bug here must not end the worker, and the sender waits
            log.exception("the reload of %s failed", name)
            refusal = f"the reload failed: {error}"
        if not refusal:
            what = f"the drop-in file of {name}" if name else "its configuration"
            log.info("worker %s: reloads %s", self._task.worker, what)
            self.reloaded = True
            self._end()
        _answer(question, refusal)

    async def blocker(self, *, forced: bool) -> str:
        """Return why the worker cannot be restarted with another configuration; empty when it can."""
        if self._by_hand:
            return f"worker {self._task.worker} was started by hand: end it, and start it with the new file"
        return "" if forced else self._require_rest()

    async def refusal(self, adapter: str, *, forced: bool = False) -> str:
        """Return why an adapter's file cannot be reloaded now; empty when it can."""
        meant = [task for task in self._task.robots if task.adapter == adapter and task.file]
        if not meant:
            return f"worker {self._task.worker} runs no drop-in file with the adapter {adapter!r}"
        if self._by_hand:
            return f"worker {self._task.worker} was started by hand: end it and start it again"
        moving = "" if forced else self._require_rest()
        if moving:
            return moving
        flaw = await asyncio.to_thread(flaw_of, meant, self._task.folder)
        # A robot may have been commanded during the check; no step lies between this and the end.
        return flaw or ("" if forced else self._require_rest())

    def _require_rest(self) -> str:
        """Return which robot of this worker, of any adapter, is not at rest."""
        return next(filter(None, map(not_resting, self._robots())), "")


def flaw_of(robots: Iterable[RobotTask], folder: str) -> str:
    """Return the first flaw of the robots' changed files, each checked in a process of its own. Blocks."""
    for robot in robots:
        path = Path(robot.file)
        unsafe = insecure(path.parent) or insecure(path)
        if unsafe:
            return f"{path}: {unsafe}"
        probe = Probe(path)
        try:
            content = probe.found()
            if robot.adapter not in {kind.name for kind in content.kinds}:
                reports = "; ".join(content.reports) or f"it has no adapter {robot.adapter!r} any more"
                return f"{path}: {reports}"
            checked = probe.check(_case(robot, folder))
        except ProbeError as error:
            return f"{path}: {error}"
        finally:
            probe.close()
        if checked.flaws:
            flaw = checked.flaws[0]
            why = f"{'.'.join(map(str, flaw.at.path))}: {flaw.message} {flaw.hint}".strip(": ")
            return f"{robot.name}: the changed file refuses its config: {why}"
    return ""


def _case(robot: RobotTask, folder: str) -> ConfigCase:
    """Return a robot's config as a case to check; places are the names of its fields."""
    steps = [(), *((name,) for name in msgspec.json.decode(robot.given))]
    marks = tuple((at, ProblemPlace(robot.file, 0, 0, at)) for at in steps)
    return ConfigCase(robot.adapter, robot.given, (), folder, marks=marks)


def _answer(question: Query, refusal: str) -> None:
    status = ReplyStatus.REJECTED if refusal else ReplyStatus.ACCEPTED
    question.reply(msgspec.json.encode(Reply(NAME, status, refusal)))
    question.close()
