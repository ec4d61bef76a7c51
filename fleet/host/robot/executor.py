"""Executor of discrete commands: one moving command at a time, each answered exactly once."""

from __future__ import annotations

import asyncio
import inspect
import logging
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

import msgspec

from fleet.adapter import Adapter
from fleet.commands import CommandSpec, arguments
from fleet.errors import CommandError, LinkError, Refused, TimedOut
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import start_command
from fleet.host.runtime.cancellation import IGNORED_AFTER, cancel_and_wait, closing, was_cancelled
from fleet.model.command import Command, ReplyStatus
from fleet.runtime.event_loop import make_task, start_task
from fleet.runtime.exception_barrier import failure_of, failure_text

log = logging.getLogger(__name__)

AT_ONCE = 8  # commands without motion in progress at once; more are refused


class _Job(msgspec.Struct, frozen=True):
    """One running command; ``failed`` is called if it fails by itself."""

    adapter: Adapter[Any]
    spec: CommandSpec
    request: Command
    receipt: Receipt
    failed: Callable[[], None]


class Executor:
    """Running commands of one robot.

    The sender is answered at once when a command is cancelled or times out, however the adapter's method
    reacts to the cancellation. Each command is in the ``journal`` before its method is called; a moving
    command waits until earlier stops, and motion that was cancelled, have ended. ``barred`` returns why
    nothing may move the robot by then, else None.
    """

    def __init__(
        self,
        *,
        crashed: Callable[[Exception], None],
        journal: RobotJournal,
        barred: Callable[[], str | None] = lambda: None,
        log: logging.Logger = log,
    ) -> None:
        self._crashed = crashed
        self._barred = barred
        self._log = log
        self._journal = journal
        self._tasks: set[asyncio.Task[None]] = set()
        self._stops: set[asyncio.Task[None]] = set()
        self._leaving: set[asyncio.Task[None]] = set()  # cancelled motion that has not ended yet
        self._mover: asyncio.Task[None] | None = None
        self._receipt: Receipt | None = None  # of the moving command
        self.moving = ""
        self.safe = False  # the moving command only makes things safer (a landing)

    def start(
        self,
        adapter: Adapter[Any],
        spec: CommandSpec,
        request: Command,
        receipt: Receipt,
        *,
        failed: Callable[[], None],
    ) -> None:
        """Run a command; a moving one replaces the moving one before it.

        ``failed`` is called if it fails by itself, not if it was cancelled or crashed.
        """
        if spec.moves:
            self.cancel(f"superseded by {request.name}")
        elif len(self._tasks) >= AT_ONCE:
            receipt.reject(f"{AT_ONCE} commands are under way; try again")
            return
        job = _Job(adapter, spec, request, receipt, failed)
        # Motion begins soon: it has to be known here before. Nothing overtakes what has not begun yet.
        at_once = not spec.moves and self._all_begun()
        task = self.spawn(self._run(job), name=request.name, make=start_task if at_once else make_task)
        if spec.moves:
            self._mover, self._receipt, self.moving = task, receipt, request.name
            self.safe = spec.safe
            task.add_done_callback(self._moved)
        asyncio.get_running_loop().call_soon(self._limit, task, job)  # call_soon: only after its first step

    def _limit(self, task: asyncio.Task[None], job: _Job) -> None:
        """Start the timeout of a command that has not ended at once."""
        if task.done():
            return
        name, seconds = job.request.name, job.spec.timeout

        def give_up() -> None:
            self._moved(task)
            job.receipt.fail(TimedOut(f"{name} was not seen done within {seconds:g} s"))
            self.end(task, "its time was over")
            job.failed()

        timer = asyncio.get_running_loop().call_later(seconds, give_up)
        task.add_done_callback(lambda _: timer.cancel())

    def cancel(self, why: str) -> None:
        """Cancel the moving command; its receipt gets the reason."""
        if self._mover is not None and self._receipt is not None:
            mover, receipt = self._mover, self._receipt
            self._moved(mover)
            receipt.reject(why)
            self.end(mover, why)

    def end(self, task: asyncio.Task[None], why: str) -> None:
        """Cancel a task that moves the robot; later moving requests wait for its end.

        One that ignores its cancellation is a failure of the adapter, and no longer waited for.
        """

        def ignored(error: Exception) -> None:
            self._leaving.discard(task)
            self._crashed(error)

        self._leaving.add(task)
        task.add_done_callback(self._leaving.discard)
        cancel_and_wait(task, why, ignored)

    def stop(
        self, work: Coroutine[object, object, None], name: str, *, ended: Callable[[], None] = lambda: None
    ) -> None:
        """Execute a stop; later moving commands wait for its end. ``ended`` is called after that."""
        stop = self.spawn(work, name=name)
        self._stops.add(stop)
        stop.add_done_callback(self._stops.discard)
        stop.add_done_callback(lambda _: ended())

    @property
    def stopping(self) -> bool:
        """True while a stop is in progress."""
        return bool(self._stops)

    async def wait_standing(self) -> None:
        """Wait until stops in progress and cancelled motion have ended: what is given next follows them."""
        while busy := self._stops | self._leaving:
            await asyncio.wait(busy, timeout=IGNORED_AFTER)

    async def ready(self) -> None:
        """Wait as ``standing``; raises Refused if nothing may move the robot by then."""
        await self.wait_standing()
        if why := self._barred():
            raise Refused(why)

    def spawn(
        self,
        work: Coroutine[object, object, None],
        *,
        name: str,
        make: Callable[..., asyncio.Task[None]] = make_task,
    ) -> asyncio.Task[None]:
        """Start a task of this robot; it is referenced until it ends."""
        task = make(asyncio.get_running_loop(), work, name=f"command:{name}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _all_begun(self) -> bool:
        """Return whether all running commands and stops have made their first step."""
        states = [inspect.getcoroutinestate(task.get_coro()) for task in self._tasks]  # type: ignore[arg-type]
        return inspect.CORO_CREATED not in states

    def _moved(self, task: asyncio.Task[None]) -> None:
        """Record the end of the moving command."""
        if self._mover is task:
            self._mover, self._receipt, self.moving, self.safe = None, None, "", False

    async def _run(self, job: _Job) -> None:
        """Run one command to its end and answer."""
        try:
            request, receipt = job.request, job.receipt
            self._journal.note(request.id, request.name, transport=request.origin.transport, receipt=receipt)
            if job.spec.moves:
                await (self.wait_standing() if job.spec.safe else self.ready())
            call = start_command(job.adapter, job.spec, request)
            data = await (_stepped(call, receipt) if job.spec.streams else call)
            msgspec.json.encode(data)  # raises if it cannot be encoded: the sender must get an answer
            receipt.done(data)
        except asyncio.CancelledError:
            if was_cancelled():
                raise
            self._ended_badly(RuntimeError("it was cancelled from within"), job)
        except (KeyboardInterrupt, GeneratorExit):
            raise
        except BaseException as error:  # noqa: BLE001 - passed to the sender, and to the runner if it is a crash
            self._ended_badly(failure_of(error), job)

    def _ended_badly(self, error: Exception, job: _Job) -> None:
        """Answer a command that raised; a cancelled command has been answered already."""
        name, receipt = job.request.name, job.receipt
        if isinstance(error, TimeoutError):
            error = TimedOut(f"{name}: the robot did not answer in time")
        if isinstance(error, CommandError | LinkError):
            was_ended = receipt.ended is not None
            receipt.fail(error)
            if not was_ended:
                job.failed()
            return
        self._log.error("the adapter failed in %s", name, exc_info=error)
        receipt.reject(f"the adapter failed: {failure_text(error)}")
        self._crashed(error)


async def _stepped(call: AsyncIterator[object], receipt: Receipt) -> None:
    """Run a command through its steps; the first one sends the receipt."""
    async with closing(call) as steps:
        async for _ in steps:
            receipt.accept()


def admits(spec: CommandSpec, request: Command, receipt: Receipt, doing: str) -> bool:
    """Return whether a command is valid now; if not, refuse it and leave the robot's activity alone.

    A command that does not interrupt is also refused while the robot is ``doing`` something.
    """
    if doing and not spec.interrupts:
        receipt.reject(f"busy with {doing}")
        return False
    try:
        arguments(spec, request.data)
    except Refused as error:
        receipt.fail(error)
        return False
    return True


def may_still_move(spec: CommandSpec, receipt: Receipt, *, superseding: bool) -> bool:
    """Return True if the robot may be moving after a failed command, and has to be stopped.

    After a refusal by the robot, its previous motion continues. A command that it accepted, or did not
    answer, may still move it, but one that only makes things safer (a landing) is not interrupted.
    """
    refused = receipt.first is not None and receipt.first.status in (
        ReplyStatus.REJECTED,
        ReplyStatus.DENIED,
    )
    return spec.moves and (superseding if refused else not spec.safe)
