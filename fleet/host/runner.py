"""The wall around one robot: runs its adapter, again and again, and keeps its failures to itself.

=====================  ==============================================================  ==========
what ends a run        what happens                                                    health
=====================  ==============================================================  ==========
LinkLost               halted, opened again after a growing wait                       offline
LinkRefused, Fault     halted, tried again at the longest wait: a person must act      fault
anything else          traceback, halted, tried again; 3 in 60 s: quarantine           fault
=====================  ==============================================================  ==========
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import Fault, LinkLost, LinkRefused, NotReady
from fleet.host.desk import Desk
from fleet.host.handle import Handle
from fleet.model.health import Health, Level

STRIKES = 3
STRIKE_WINDOW = 60.0  # s
SLOW_RETRY = 30.0  # s between tries of what only a person can mend


class Runner:
    """One robot's life. ``make`` gives a fresh adapter, ``handle`` a fresh handle for each run."""

    def __init__(
        self,
        desk: Desk,
        *,
        make: Callable[[], Adapter[Any]],
        handle: Callable[[Runner], Handle],
        waits: Callable[[], Iterator[float]],
        clock: Clock,
        changed: Callable[[], None],
    ) -> None:
        self.desk = desk
        self.health = Health(Level.OFFLINE, "starting")
        self._make = make
        self._handle = handle
        self._new_waits = waits
        self._clock = clock
        self._changed = changed
        self._log = logging.getLogger(f"fleet.robot.{desk.name}")
        self._crash: asyncio.Future[None] | None = None
        self._strikes: deque[float] = deque(maxlen=STRIKES)
        self._lifted = asyncio.Event()
        self._told = ""

    async def run(self) -> None:
        """Serve the robot until cancelled; then bring it to a standstill."""
        waits = self._new_waits()
        while True:
            began = self._clock.monotonic()
            health = await self._once()
            if self._clock.monotonic() - began > SLOW_RETRY:
                waits = self._new_waits()
            self._set(health)
            if self._struck_out():
                await self._quarantine(health)
                waits = self._new_waits()
                continue
            slow = health.level is Level.FAULT and not self._strikes
            await asyncio.sleep(SLOW_RETRY if slow else next(waits))

    def crashed(self, error: Exception) -> None:
        """End the run because the adapter raised what it may not; on the loop."""
        if self._crash is not None and not self._crash.done():
            self._crash.set_exception(error)

    def blocked(self, where: str, seconds: float) -> None:
        """Count a block of the event loop against this robot."""
        self._log.error("blocked the event loop for %.2f s at %s", seconds, where)
        self._strike()
        self._set(Health(Level.DEGRADED, f"blocked the event loop at {where}"))
        if self._struck_out():
            advice = f"give {self.desk.name} a worker of its own (worker: {self.desk.name})"
            self.crashed(RuntimeError(f"blocked the event loop {STRIKES} times; {advice}"))

    def lift(self) -> None:
        """End a quarantine."""
        self._lifted.set()

    async def _once(self) -> Health:
        """Run the adapter once; return the health that its end means."""
        self._crash = asyncio.get_running_loop().create_future()
        handle = self._handle(self)
        adapter: Adapter[Any] | None = None
        try:
            adapter = self._make()
            self.desk.attach(adapter)
            await self._serve(adapter, handle)
        except LinkLost as error:
            return Health(Level.OFFLINE, str(error))
        except (LinkRefused, Fault) as error:
            return Health(Level.FAULT, str(error))
        except NotReady as error:
            return Health(Level.OFFLINE, str(error))
        except Exception as error:  # noqa: BLE001 - the wall: one adapter's failure is its own robot's
            self._log.exception("the adapter failed")
            self._strike()
            return Health(Level.FAULT, f"{type(error).__name__}: {error}")
        else:
            return Health(Level.OFFLINE, "the adapter ended by itself")
        finally:
            handle.close()
            self._crash.cancel()
            self.desk.detach(self.health.cause or "its adapter ended")

    async def _serve(self, adapter: Adapter[Any], handle: Handle) -> None:
        """Run until the adapter ends, crashes elsewhere, or we are cancelled; then stop the robot."""
        assert self._crash is not None
        work = asyncio.ensure_future(adapter.run(handle))
        try:
            await asyncio.wait({work, self._crash}, return_when=asyncio.FIRST_COMPLETED)
            if self._crash.done():
                self._crash.result()
            await work
        finally:
            await self._leave(adapter, work)

    async def _leave(self, adapter: Adapter[Any], work: asyncio.Future[None]) -> None:
        """Stop a robot that we were moving, while its link may still be open, and end the run."""
        if self.desk.in_control:
            adapter.halt()
            with contextlib.suppress(Exception):  # the run is over; what matters was the halt
                await self.desk.hold("the host lets go of the robot")
        work.cancel()
        await asyncio.wait({work})
        if not work.cancelled():
            work.exception()

    async def _quarantine(self, health: Health) -> None:
        """Leave the robot alone until a person lifts it."""
        self._set(
            Health(
                Level.FAULT,
                f"quarantined after {STRIKES} failures in {STRIKE_WINDOW:g} s, the last: {health.cause}; "
                f"fleet send {self.desk.name} restart_adapter",
            )
        )
        self._lifted.clear()
        await self._lifted.wait()
        self._strikes.clear()

    def _strike(self) -> None:
        """Count a failure."""
        self._strikes.append(self._clock.monotonic())

    def _struck_out(self) -> bool:
        """Return True when there were too many failures lately."""
        return len(self._strikes) == STRIKES and self._strikes[-1] - self._strikes[0] <= STRIKE_WINDOW

    def healthy(self, health: Health) -> None:
        """Take the adapter's own word of how the way to the robot is."""
        if health.level >= Level.OFFLINE:
            self.desk.lost(health.cause)
        else:
            self.desk.found()
        self._set(health)

    def _set(self, health: Health) -> None:
        """Note a health; the first of a kind is told aloud, repeats quietly."""
        if health == self.health:
            return
        self.health = health
        loud = health.level >= Level.DEGRADED and health.cause != self._told
        self._told = health.cause if health.level >= Level.DEGRADED else ""
        self._log.log(
            logging.WARNING if loud else logging.INFO,
            "%s%s",
            health.level.word,
            f": {health.cause}" * bool(health.cause),
        )
        self._changed()
