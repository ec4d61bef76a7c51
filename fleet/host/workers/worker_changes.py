"""Restarts a worker with a changed configuration, and restores the old one when that fails."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable, Mapping

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.config.load import Loaded
from fleet.host.process.rebuild import BACK_WITHIN, RESTORED, wait_until
from fleet.host.robot.rest_check import STILL
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_manager import WorkerManager
from fleet.host.workers.worker_task import task_of
from fleet.model.change import HeldRobot, HoldRequest, HoldRobot, Outcome
from fleet.model.command import Reply
from fleet.runtime.decoding import decode_json

REQUEST_WITHIN = 10.0  # s for a worker to answer whether it restarts
TRY_WITHIN = 90.0  # s for it to check a changed file, and its robots' configurations with it
ENDS_WITHIN = 15.0  # s for it to stop its robots, end, and start again
LATCHED = "emergency stop"


class WorkerChanges:
    """Changes of the workers of one edge; on the event loop."""

    def __init__(
        self,
        edge: str,
        control: ZenohSession,
        workers: Mapping[str, WorkerManager],
        robots: Mapping[str, RemoteRobot],
    ) -> None:
        self._edge, self._control = edge, control
        self._workers, self._robots = workers, robots

    def blocker(self, worker: str) -> str:
        """Return why a worker cannot restart now, as far as the edge knows."""
        if worker not in self._workers:
            return f"worker {worker} was started by hand: end it, and start it with the new file"
        for robot in self._of(worker):
            state = robot.state()
            moves = state.speed is not None and state.speed > STILL
            if (state.activity and state.activity != LATCHED) or state.armed or state.run or moves:
                return f"{state.name}, of the same worker, does not rest"
        return ""

    async def hold(self, worker: str, robots: Mapping[str, HoldRobot]) -> dict[str, HeldRobot]:
        """Restrict a worker's robots to the stricter parts of new configurations; empty if it is silent."""
        return await self._request_to_hold(worker, HoldRequest(dict(robots))) or {}

    async def regroup(self, groups: Mapping[str, Iterable[str]]) -> str:
        """Replace the groups in all workers; return which of them do not answer."""
        requested = HoldRequest(groups={name: list(robots) for name, robots in groups.items()})
        workers = sorted({robot.worker for robot in self._robots.values()})
        answers = await asyncio.gather(*(self._request_to_hold(worker, requested) for worker in workers))
        silent = [worker for worker, answer in zip(workers, answers, strict=True) if answer is None]
        return "; ".join(map(_silent, silent))

    async def _request_to_hold(self, worker: str, requested: HoldRequest) -> dict[str, HeldRobot] | None:
        """Ask a worker; return the settings that its robots are held to, None if it is silent."""
        if self._is_silent(worker):
            return None
        loop = asyncio.get_running_loop()
        heard: asyncio.Future[dict[str, HeldRobot] | None] = loop.create_future()

        def resolve(held: dict[str, HeldRobot] | None) -> None:
            if not heard.done():
                heard.set_result(held)

        self._control.request_later(
            keys.hold(self._edge, worker),
            msgspec.json.encode(requested),
            timeout=REQUEST_WITHIN,
            on_answer=lambda data: _soon(loop, resolve, decode_json(data, dict[str, HeldRobot])),
            on_end=lambda: _soon(loop, resolve, None),
        )
        return await heard

    def all_run_with(self, after: Loaded) -> None:
        """Record the configuration of all workers, for their next processes."""
        for worker in self._workers:
            self.runs_with(worker, after)

    def runs_with(self, worker: str, after: Loaded) -> None:
        """Record the configuration of a worker, for its next process."""
        if manager := self._workers.get(worker):
            manager.replace(msgspec.json.encode(task_of(after, worker)))

    async def change(self, worker: str, after: Loaded, *, force: bool, gone: str = "") -> tuple[Outcome, str]:
        """Restart a worker with the configuration ``after``; return the outcome, and why it failed.

        A robot that is ``gone`` afterwards is not waited for.

        PARTLY: it runs with it, but not all robots that were online are back, and another is not at rest.
        """
        manager = self._workers.get(worker)
        if manager is None:
            why = f"worker {worker} was started by hand: end it, and start it with the new file"
            return Outcome.REFUSED, why
        if self._is_silent(worker):
            return Outcome.REFUSED, _silent(worker)
        answered = [robot for robot in self._of(worker) if robot.state().reachable and robot.name != gone]
        new = msgspec.json.encode(task_of(after, worker))
        old, started = manager.replace(new), manager.started
        refusal = await self.start_again(worker, force=force)
        if refusal and manager.given != new:  # else it ended by itself, and was restarted with it
            manager.replace(old)
            return Outcome.REFUSED, refusal
        trouble = await self._back(manager, started, answered)
        if not trouble:
            return Outcome.DONE, ""
        manager.replace(old)
        started = manager.started
        refusal = await self.start_again(worker, force=force)
        if refusal and refusal != _silent(worker):
            manager.replace(new)
            return Outcome.PARTLY, f"{trouble}; worker {worker} goes on with the new configuration: {refusal}"
        again = await self._back(manager, started, answered)
        return Outcome.FAILED, f"{trouble}; " + (again or RESTORED)

    async def _back(self, manager: WorkerManager, started: int, robots: list[RemoteRobot]) -> str:
        """Wait until a worker and its robots are back; return which are not."""

        def is_back() -> bool:
            return manager.started > started and not self._is_silent(manager.name)

        if not await wait_until(is_back, ENDS_WITHIN):
            return f"worker {manager.name} did not come up within {ENDS_WITHIN:g} s"
        if await wait_until(lambda: all(robot.state().reachable for robot in robots), BACK_WITHIN):
            return ""
        away = [robot.state() for robot in robots if not robot.state().reachable]
        return "; ".join(
            f"{state.name} did not answer within {BACK_WITHIN:g} s: {state.cause}" for state in away
        )

    def _of(self, worker: str) -> list[RemoteRobot]:
        """Return the robots of a worker."""
        return [robot for robot in self._robots.values() if robot.worker == worker]

    def _is_silent(self, worker: str) -> bool:
        """Return whether a worker is silent: a query to it would wait for its full time limit."""
        robots = self._of(worker)
        return bool(robots) and all(robot.silent for robot in robots)

    async def start_again(self, worker: str, adapter: str = "", *, force: bool) -> str:
        """Make a worker end, so that it is restarted; return why it does not.

        ``adapter``: because that adapter's drop-in file has changed; the worker checks it first.
        """
        loop = asyncio.get_running_loop()
        heard: asyncio.Future[str] = loop.create_future()

        def resolve(why: str) -> None:
            if not heard.done():
                heard.set_result(why)

        def answered(data: bytes) -> None:
            reply = decode_json(data, Reply)
            loop.call_soon_threadsafe(resolve, "" if reply.ok else reply.reason or "it refuses")

        def ended() -> None:
            loop.call_soon_threadsafe(resolve, _silent(worker))

        self._control.request_later(
            keys.reload(self._edge, worker),
            adapter.encode(),
            timeout=TRY_WITHIN if adapter else REQUEST_WITHIN,
            parameters={"force": "1"} if force else None,
            on_answer=answered,
            on_end=ended,
        )
        return await heard


def _soon(
    loop: asyncio.AbstractEventLoop,
    resolve: Callable[[dict[str, HeldRobot] | None], None],
    held: dict[str, HeldRobot] | None,
) -> None:
    """Pass an answer to the loop, unless that is closed."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(resolve, held)


def _silent(worker: str) -> str:
    """Return the text for a worker that does not answer, for example because it does not run."""
    return f"worker {worker} does not answer"
