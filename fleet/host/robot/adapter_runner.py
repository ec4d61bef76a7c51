"""Exception barrier around one robot: runs its adapter, restarts it, and contains its failures.

end of a run           reaction                                                        health
LinkLost               halted, reopened after a growing delay                          offline
LinkRefused, Fault     halted, retried at the longest delay: a person must act         fault
anything else          traceback, halted, retried; 3 in 60 s: quarantine               fault
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import msgspec

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import Fault, LinkError, LinkLost, LinkRefused, NotReady
from fleet.host.robot.adapter_health import AdapterHealth
from fleet.host.robot.controller import RobotController
from fleet.host.robot.failure_counter import FAILURE_WINDOW, MOST_FAILURES, FailureCounter
from fleet.host.robot.robot_handle import RobotHandle
from fleet.host.runtime.cancellation import result_of, retrieve_exception
from fleet.model.health import Health, Level
from fleet.runtime.exception_barrier import (
    call_guarded,
    error_text,
    failure_of,
    failure_text,
    guarded,
    log_exceptions,
)

SLOW_RETRY = 30.0  # s between retries of a failure that only a person can fix
NO_FAILSAFE = Health(
    Level.DEGRADED,
    "nothing stops it if this process dies: its adapter declares no failsafe and leaves no halt",
)
NO_CAUSE = "its adapter reports no cause"
LEAVE_WITHIN = 2.0  # s for a cancelled run to end


class _Restart(Exception):
    """A person asked to restart the run."""


class _RunEnd(msgspec.Struct, frozen=True):
    """Meaning of the end of a run; ``slow``: only a person can fix it, so retry slowly."""

    health: Health
    slow: bool = False


_ENDS: tuple[tuple[type[Exception], Level, bool], ...] = (
    (LinkLost, Level.OFFLINE, False),
    (NotReady, Level.OFFLINE, False),
    (_Restart, Level.OFFLINE, False),
    (LinkRefused, Level.FAULT, True),
    (Fault, Level.FAULT, True),
)
"""Meaning of an error, by its class; any other is a failure of the adapter itself."""


class AdapterRunner:
    """Lifecycle of one robot: each attempt gets a new handle from ``handle`` and a new adapter from ``make``.

    ``level_changed`` receives each new health level except the steps of a start.
    """

    def __init__(
        self,
        controller: RobotController,
        *,
        make: Callable[[RobotHandle], Adapter[Any]],
        handle: Callable[[AdapterRunner], RobotHandle],
        waits: Callable[[], Iterator[float]],
        clock: Clock,
        changed: Callable[[], None],
        level_changed: Callable[[Health], None],
    ) -> None:
        self.controller = controller
        self.leftover: asyncio.Future[None] | None = None  # a run that does not end after its cancellation
        controller.attached.halt_failed = self._halt_failed
        self._make = make
        self._handle = handle
        self._new_waits = waits
        self._clock = clock
        self._log = logging.getLogger(f"fleet.robot.{controller.name}")
        self._health = AdapterHealth(self._log, changed=changed, level_changed=level_changed)
        self._log_exceptions = log_exceptions(
            self._log, "the loss of the robot could not be recorded; it is halted anyway"
        )
        self._crash: asyncio.Future[None] | None = None
        self._failures = FailureCounter()
        self._lifted = asyncio.Event()
        self._ending: asyncio.Event | None = None  # while an attempt ends; set once the robot was stopped
        self._has_failsafe: Callable[[], object] = lambda: True  # true if something stops it after our death

    @property
    def health(self) -> Health:
        """Health of the robot now."""
        return self._health.now

    async def run(self) -> None:
        """Run the robot until cancelled; then bring it to a standstill."""
        waits = self._new_waits()
        while True:
            self._lifted.clear()
            began = self._clock.monotonic()
            end = await self._once()
            if self._clock.monotonic() - began > SLOW_RETRY:
                waits = self._new_waits()
            self._health.set(end.health)
            await self._wait_for_leftover()
            if self._failures.exceeded:
                await self._quarantine(end.health)
                waits = self._new_waits()
            else:
                await self._wait_to_retry(SLOW_RETRY if end.slow else next(waits))

    def crashed(self, error: Exception) -> None:
        """End the run because the adapter raised an unexpected error; on the event loop."""
        if self._crash is not None and not self._crash.done():
            self._crash.set_exception(failure_of(error))

    def _halt_failed(self, error: Exception) -> None:
        """End the run because the adapter's halt raised; from any thread; never raises."""
        if self._crash is not None:
            with contextlib.suppress(RuntimeError):  # the event loop is closed
                self._crash.get_loop().call_soon_threadsafe(self.crashed, error)

    def blocked(self, where: str, seconds: float) -> None:
        """Count a block of the event loop, longer than ``seconds``, against this robot."""
        self._log.error("blocked the event loop for more than %.2f s at %s", seconds, where)
        self._failures.count(self._clock.monotonic())
        if self.health.level < Level.OFFLINE:
            self._health.set(Health(Level.DEGRADED, f"blocked the event loop at {where}"))
        if self._failures.exceeded:
            advice = f"give {self.controller.name} a worker of its own (worker: {self.controller.name})"
            self.crashed(
                RuntimeError(f"blocked the event loop {MOST_FAILURES} times, the last at {where}; {advice}")
            )

    def restart(self) -> None:
        """End a quarantine or a delay at once; a run in progress ends and starts again."""
        self._lifted.set()
        self.crashed(_Restart("its restart was requested"))

    def stand_by(self, cause: str) -> None:
        """Set the reason for which the robot is not run at all."""
        self._health.set(Health(Level.OFFLINE, cause))

    async def _once(self) -> _RunEnd:
        """Run the adapter once; return the meaning of its end."""
        self._ending = None
        self._crash = asyncio.get_running_loop().create_future()
        self._health.begin_start()
        handle = self._handle(self)
        end = _RunEnd(Health(Level.OFFLINE, "the adapter ended by itself"))
        try:
            await self._serve(handle)
        except Exception as error:  # noqa: BLE001 - exception barrier: one robot's failure must not stop the others
            end = self._meaning_of(error)
        finally:
            handle.close()
            self._health.end_start()
            self._crash.cancel()
            retrieve_exception(self._crash)
            self._log_exceptions(self.controller.detach)(end.health.cause)
            await _uninterrupted(handle.withdraw_halt())
        return end

    def _meaning_of(self, error: Exception) -> _RunEnd:
        """Return the meaning of an error; a failure of the adapter itself counts towards quarantine."""
        cause = _cause(error)
        for kind, level, slow in _ENDS:
            if isinstance(cause, kind):
                return _RunEnd(Health(level, error_text(cause)), slow)
        self._log.error("the adapter failed", exc_info=error)
        self._failures.count(self._clock.monotonic())
        return _RunEnd(Health(Level.FAULT, failure_text(cause)))

    async def _serve(self, handle: RobotHandle) -> None:
        """Run until the adapter ends, crashes elsewhere, or the task is cancelled; then stop the robot."""
        assert self._crash is not None
        work = asyncio.ensure_future(guarded(lambda: self._attempt(handle)))
        why = "the edge has stopped running it"
        try:
            await asyncio.wait({work, self._crash}, return_when=asyncio.FIRST_COMPLETED)
            if self._crash.done():
                self._crash.result()
            result_of(work)
        except Exception as error:
            why = _reason(error)
            raise
        finally:
            await _uninterrupted(self._end_attempt(work, why))

    async def _attempt(self, handle: RobotHandle) -> None:
        """Connect and run; contexts are exited only after the robot was brought to a standstill."""
        async with handle.contexts:
            adapter = call_guarded(self._make, handle)
            self._has_failsafe = lambda: (
                adapter.failsafe or handle.has_left_halt or not self.controller.can.moves
            )
            await adapter.connect()
            self.controller.attach(adapter)
            handle.connected(answers=adapter.connects())
            why = "the adapter ended by itself"
            try:
                await adapter.run()
            except BaseException as error:
                why = _reason(error)
                raise
            finally:
                await _uninterrupted(self._stand(why, open_still=False))
                handle.close()  # the adapter gets no calls while its link is being closed
                self._log_exceptions(self.controller.detach)(why)

    async def _end_attempt(self, work: asyncio.Future[None], why: str) -> None:
        """Stop the robot, if we controlled it, while its link may still be open; then end the attempt."""
        await self._stand(why, open_still=not work.done())
        work.cancel()
        work.add_done_callback(retrieve_exception)
        _, pending = await asyncio.wait({work}, timeout=LEAVE_WITHIN)
        self.leftover = work if pending else None

    async def _stand(self, why: str, *, open_still: bool) -> None:
        """Bring the robot to a standstill at the end of an attempt, once; a second caller waits for it.

        ``open_still``: the run still goes on, so its link is known to be open.
        """
        if self._ending is not None:
            await self._ending.wait()
            return
        self._ending = asyncio.Event()
        motion = self.controller.motion
        in_control = motion.in_control
        self._log_exceptions(self.controller.lost)(why)
        if in_control or motion.may_be_moving:
            self.controller.halt()
            await motion.hold_at_end(why, open_still=open_still)
        self._ending.set()

    async def _wait_for_leftover(self) -> None:
        """Wait for a run that ignores its cancellation: two runs must never control one robot."""
        if self.leftover is None:
            return
        self._health.set(
            Health(Level.FAULT, "its adapter does not end; restart the edge, and give it a worker of its own")
        )
        await asyncio.wait({self.leftover})
        self.leftover = None

    async def _quarantine(self, health: Health) -> None:
        """Suspend the robot until a person lifts the quarantine."""
        self._unreached(Health(Level.FAULT, quarantined(self.controller.name, health.cause)))
        self._lifted.clear()
        await self._lifted.wait()
        self._failures.clear()
        self._unreached(Health(Level.OFFLINE, "starting again"))

    def _unreached(self, health: Health) -> None:
        """Set the health of a robot that is not run; refusals of requests name the same cause."""
        self._log_exceptions(self.controller.lost)(health.cause)
        self._health.set(health)

    async def _wait_to_retry(self, seconds: float) -> None:
        """Wait before the next attempt, or until a person asks for it."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._lifted.wait()

    def healthy(self, health: Health) -> None:
        """Apply the adapter's own report of its connection's health."""
        if self._ending is not None:
            return
        if health.level is not Level.OK and not health.cause:
            health = Health(health.level, NO_CAUSE)
        if health.level is Level.OK and not self._has_failsafe():
            health = NO_FAILSAFE
        if health.level is Level.FAULT:
            self.controller.faulted(health.cause)
        elif health.level is Level.OFFLINE:
            self.controller.lost(health.cause)
        else:
            self.controller.found()
        if health.level in {Level.OK, Level.FAULT}:
            self._health.end_start()
        self._health.set(health)


def quarantined(robot: str, last: str) -> str:
    """Return the cause in the health of a quarantined robot, after its ``last`` failure."""
    return (
        f"quarantined after {MOST_FAILURES} failures in {FAILURE_WINDOW:g} s, the last: {last}; "
        f"fleet logs shows where, then: fleet send {robot} restart_adapter"
    )


def _cause(error: BaseException) -> BaseException:
    """Return the root cause; of a task group's errors preferably one that is not a link error."""
    leaves = [error]
    while groups := [leaf for leaf in leaves if isinstance(leaf, BaseExceptionGroup)]:
        leaves = [leaf for leaf in leaves if leaf not in groups]
        leaves += [inner for group in groups for inner in group.exceptions]
    return next((leaf for leaf in leaves if not isinstance(leaf, LinkError)), leaves[0])


def _reason(error: BaseException) -> str:
    """Return why a run ended; never empty, which would mean that the robot can be reached."""
    cause = _cause(error)
    if isinstance(cause, asyncio.CancelledError):
        return str(cause) or "its run was ended"
    return error_text(cause)


async def _uninterrupted(work: Coroutine[object, object, None]) -> None:
    """Await ``work`` to its end even if cancelled meanwhile, then pass the cancellation on.

    ``work`` has to be bounded in time.
    """
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.wait({task})
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        raise cancelled
    task.result()
