"""The wall around one robot: runs its adapter, again and again, and keeps its failures to itself.

what ends a run        what happens                                                    health
LinkLost               halted, opened again after a growing wait                       offline
LinkRefused, Fault     halted, tried again at the longest wait: a person must act      fault
anything else          traceback, halted, tried again; 3 in 60 s: quarantine           fault
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
from fleet.host.robot.controller import RobotController
from fleet.host.robot.robot_handle import RobotHandle
from fleet.host.robot.run_health import RunHealth
from fleet.host.robot.strikes import STRIKE_WINDOW, STRIKES, Strikes
from fleet.host.runtime.cancellation import result_of, retrieve_exception
from fleet.model.health import Health, Level
from fleet.runtime.exception_barrier import call_guarded, failure_of, guarded

SLOW_RETRY = 30.0  # s between tries of what only a person can mend
NOTHING_STOPS_IT = Health(
    Level.DEGRADED,
    "nothing stops it if this process dies: its adapter declares no failsafe and leaves no halt",
)
LEAVE_WITHIN = 2.0  # s that a run gets to end once it is cancelled


class _Restart(Exception):
    """Somebody asked for the run to begin anew."""


class _End(msgspec.Struct, frozen=True):
    """What the end of a run means; ``slow``: only a person can mend it."""

    health: Health
    slow: bool = False


_ENDS: tuple[tuple[type[Exception], Level, bool], ...] = (
    (LinkLost, Level.OFFLINE, False),
    (NotReady, Level.OFFLINE, False),
    (_Restart, Level.OFFLINE, False),
    (LinkRefused, Level.FAULT, True),
    (Fault, Level.FAULT, True),
)
"""What an error means; whatever is not here is a failure of the adapter itself."""


class AdapterRunner:
    """One robot's life. ``handle`` gives a fresh handle for each attempt, ``make`` a fresh adapter with it.

    ``told`` hears of each new level of its health, but for the steps of a start.
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
        told: Callable[[Health], None],
    ) -> None:
        self.controller = controller
        self.leftover: asyncio.Future[None] | None = None  # a run that does not end when it is cancelled
        self._make = make
        self._handle = handle
        self._new_waits = waits
        self._clock = clock
        self._log = logging.getLogger(f"fleet.robot.{controller.name}")
        self._health = RunHealth(self._log, changed=changed, level_changed=told)
        self._crash: asyncio.Future[None] | None = None
        self._strikes = Strikes()
        self._lifted = asyncio.Event()
        self._leaving: asyncio.Event | None = None  # an attempt ends; set once the robot was stopped
        self._stopped_by: Callable[[], object] = lambda: True  # what stops the robot when this process dies

    @property
    def health(self) -> Health:
        """Health of the robot now."""
        return self._health.now

    async def run(self) -> None:
        """Serve the robot until cancelled; then bring it to a standstill."""
        waits = self._new_waits()
        while True:
            self._lifted.clear()
            began = self._clock.monotonic()
            end = await self._once()
            if self._clock.monotonic() - began > SLOW_RETRY:
                waits = self._new_waits()
            self._health.set(end.health)
            await self._outlive()
            if self._strikes.are_out:
                await self._quarantine(end.health)
                waits = self._new_waits()
            else:
                await self._rest(SLOW_RETRY if end.slow else next(waits))

    def crashed(self, error: Exception) -> None:
        """End the run because the adapter raised what it may not; on the loop."""
        if self._crash is not None and not self._crash.done():
            self._crash.set_exception(failure_of(error))

    def blocked(self, where: str, seconds: float) -> None:
        """Count a block of the event loop, longer than ``seconds``, against this robot."""
        self._log.error("blocked the event loop for more than %.2f s at %s", seconds, where)
        self._strikes.count(self._clock.monotonic())
        if self.health.level < Level.OFFLINE:
            self._health.set(Health(Level.DEGRADED, f"blocked the event loop at {where}"))
        if self._strikes.are_out:
            advice = f"give {self.controller.name} a worker of its own (worker: {self.controller.name})"
            self.crashed(
                RuntimeError(f"blocked the event loop {STRIKES} times, the last at {where}; {advice}")
            )

    def restart(self) -> None:
        """End a quarantine or a wait at once; a run that is under way ends and begins anew."""
        self._lifted.set()
        self.crashed(_Restart("it is being restarted, as somebody asked"))

    def stand_by(self, cause: str) -> None:
        """Note why the robot is not run at all."""
        self._health.set(Health(Level.OFFLINE, cause))

    async def _once(self) -> _End:
        """Run the adapter once; return what its end means."""
        self._leaving = None
        self._crash = asyncio.get_running_loop().create_future()
        self._health.begin_start()
        handle = self._handle(self)
        end = _End(Health(Level.OFFLINE, "the adapter ended by itself"))
        try:
            await self._serve(handle)
        except Exception as error:  # noqa: BLE001 - the wall: one adapter's failure is its own robot's
            end = self._judged(error)
        finally:
            handle.close()
            self._health.end_start()
            self._crash.cancel()
            retrieve_exception(self._crash)
            self.controller.detach(end.health.cause)
            await _uninterrupted(handle.take_halt_back())
        return end

    def _judged(self, error: Exception) -> _End:
        """Return what an error means; count it when it is a failure of the adapter itself."""
        cause = _cause(error)
        for kind, level, slow in _ENDS:
            if isinstance(cause, kind):
                return _End(Health(level, str(cause)), slow)
        self._log.error("the adapter failed", exc_info=error)
        self._strikes.count(self._clock.monotonic())
        return _End(Health(Level.FAULT, f"{type(cause).__name__}: {cause}"))

    async def _serve(self, handle: RobotHandle) -> None:
        """Run until the adapter ends, crashes elsewhere, or we are cancelled; then stop the robot."""
        assert self._crash is not None
        work = asyncio.ensure_future(guarded(lambda: self._attempt(handle)))
        why = "the host lets go of the robot"
        try:
            await asyncio.wait({work, self._crash}, return_when=asyncio.FIRST_COMPLETED)
            if self._crash.done():
                self._crash.result()
            result_of(work)
        except Exception as error:
            why = str(_cause(error))
            raise
        finally:
            await _uninterrupted(self._leave(work, why))

    async def _attempt(self, handle: RobotHandle) -> None:
        """Connect and serve; what was entered is left after the robot was brought to a standstill."""
        async with handle.contexts:
            adapter = call_guarded(self._make, handle)
            self._stopped_by = lambda: (
                adapter.failsafe or handle.has_left_halt or not self.controller.can.moves
            )
            await adapter.connect()
            self.controller.attach(adapter)
            handle.connected(answers=adapter.connects())
            why = "the adapter ended by itself"
            try:
                await adapter.run()
            except BaseException as error:
                why = str(_cause(error))
                raise
            finally:
                await _uninterrupted(self._stand(why, open_still=False))
                handle.close()  # nothing is asked of an adapter whose link is being closed
                self.controller.detach(why)

    async def _leave(self, work: asyncio.Future[None], why: str) -> None:
        """Stop a robot that we were moving, while its link may still be open, and end the attempt."""
        await self._stand(why, open_still=not work.done())
        work.cancel()
        work.add_done_callback(retrieve_exception)
        _, pending = await asyncio.wait({work}, timeout=LEAVE_WITHIN)
        self.leftover = work if pending else None

    async def _stand(self, why: str, *, open_still: bool) -> None:
        """Bring the robot to a standstill at the end of an attempt, once; whoever comes second waits for it.

        ``open_still``: its run goes on, so its link is known to be open.
        """
        if self._leaving is not None:
            await self._leaving.wait()
            return
        self._leaving = asyncio.Event()
        motion = self.controller.motion
        in_control = motion.in_control
        self.controller.lost(why)
        if in_control:
            self.controller.halt()
            with contextlib.suppress(Exception):  # the run is over; what matters was the halt
                await motion.hold(why)
                motion.may_be_moving &= not open_still
        self._leaving.set()

    async def _outlive(self) -> None:
        """Wait for a run that goes on though it was cancelled: two of them must never have one robot."""
        if self.leftover is None:
            return
        self._health.set(
            Health(Level.FAULT, "its adapter does not end; restart the edge, and give it a worker of its own")
        )
        await asyncio.wait({self.leftover})
        self.leftover = None

    async def _quarantine(self, health: Health) -> None:
        """Leave the robot alone until a person lifts it."""
        self._health.set(
            Health(
                Level.FAULT,
                f"quarantined after {STRIKES} failures in {STRIKE_WINDOW:g} s, the last: {health.cause}; "
                f"fleet send {self.controller.name} restart_adapter",
            )
        )
        self._lifted.clear()
        await self._lifted.wait()
        self._strikes.clear()
        self._health.set(Health(Level.OFFLINE, "starting again"))

    async def _rest(self, seconds: float) -> None:
        """Wait before the next try, or until a person asks for it."""
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._lifted.wait(), seconds)

    def healthy(self, health: Health) -> None:
        """Take the adapter's own word of how the way to the robot is."""
        if self._leaving is not None:
            return
        if health.level is Level.OK and not self._stopped_by():
            health = NOTHING_STOPS_IT
        if health.level is Level.FAULT:
            self.controller.faulted(health.cause)
        elif health.level is Level.OFFLINE:
            self.controller.lost(health.cause)
        else:
            self.controller.found()
        if health.level in {Level.OK, Level.FAULT}:
            self._health.end_start()
        self._health.set(health)


def _cause(error: BaseException) -> BaseException:
    """Return what went wrong; of a task group's errors one that is not the link's, where there is one."""
    leaves = [error]
    while groups := [leaf for leaf in leaves if isinstance(leaf, BaseExceptionGroup)]:
        leaves = [leaf for leaf in leaves if leaf not in groups]
        leaves += [inner for group in groups for inner in group.exceptions]
    return next((leaf for leaf in leaves if not isinstance(leaf, LinkError)), leaves[0])


async def _uninterrupted(work: Coroutine[object, object, None]) -> None:
    """Await to the end what is bounded in time, though we be cancelled meanwhile; then pass that on."""
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
