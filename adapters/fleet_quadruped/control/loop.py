"""Fixed-rate loop: absolute deadlines, no asyncio, no garbage collector, real-time priority if permitted."""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
import select
from collections.abc import Callable, Mapping
from typing import Protocol

import msgspec

from fleet import CanBus, CanFrame, Clock, interpreter_settings
from fleet_quadruped.can.capture import Capture
from fleet_quadruped.can.relay import RelaySender
from fleet_quadruped.control.orders import DogState, LoopTiming, Order
from fleet_quadruped.safety.stages import MEANT

log = logging.getLogger(__name__)

PRIORITY = 40
_GATHER = 0.6  # share of a cycle in which the drives may answer
_LATE = 0.5  # share of a cycle; a later start counts as an overrun
_ALL_MEMORY = 3  # MCL_CURRENT | MCL_FUTURE
_WAIT = 0.002  # s of waiting on one bus before the next


class LoopController(Protocol):
    """Controller of a robot with our drives, or of a self-walking machine."""

    @property
    def clamped(self) -> int:
        """Number of targets changed by the limits."""

    @property
    def dt(self) -> float:
        """Control cycle in s."""

    @property
    def resting(self) -> bool:
        """True when the process may end."""

    @property
    def oldest(self) -> float:
        """Age of the oldest feedback, s."""

    def begin(self, now: float) -> None:
        """Begin a cycle: request feedback."""

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""

    def complete(self) -> bool:
        """Return True when all feedback of this cycle has arrived."""

    def finish(self, now: float, dt: float, order: Order) -> None:
        """Decide, and write."""

    def state(self, now: float, timing: LoopTiming) -> DogState:
        """Return the newest state."""

    def abandon(self) -> None:
        """Make the robot as safe as it can still be: this controller ends without a successor."""


class OrderExchange(Protocol):
    """Source of orders and sink of states."""

    def order(self) -> Order:
        """Return the newest order."""

    def put(self, state: DogState) -> None:
        """Publish a new state."""


def realtime() -> bool:
    """Request a real-time priority and locked memory; return whether the priority was granted."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).mlockall(_ALL_MEMORY)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        log.warning("no real-time priority: allow it with LimitRTPRIO=%d or CAP_SYS_NICE", PRIORITY)
        return False
    return True


class ControlLoop:
    """Runs a controller on open buses until it is dismissed and the robot is off.

    ``moved`` is called with the cycle time (s) after each cycle, to advance a robot simulated in this
    process. ``capture`` writes the frames before a latched fault to a file, ``relay`` passes all frames to a
    recorder. ``owner`` is a descriptor whose end of file ends the loop. Bytes before it mean an orderly end;
    without any, the adapter's process has died.
    """

    def __init__(
        self,
        controller: LoopController,
        buses: Mapping[str, CanBus],
        exchange: OrderExchange,
        clock: Clock,
        *,
        owner: int | None = None,
        moved: Callable[[float], None] | None = None,
        capture: Capture | None = None,
        relay: RelaySender | None = None,
    ) -> None:
        self._controller = controller
        self._buses = buses
        self._exchange = exchange
        self._clock = clock
        self._owner = owner
        self._moved = moved
        self._capture = capture
        self._relay = relay
        self._orphan = self._dismissed = False
        self._priority = False
        self._cycles = self._overruns = self._incomplete = 0
        self._window = (0.0, 0, 0.0)  # start (s), number of cycles, longest cycle (s)
        self._rate = self._worst = 0.0

    def run(self) -> None:
        """Run the loop; raises LinkLost if a bus fails."""
        self._priority = realtime()
        with interpreter_settings(collect=False):
            try:
                self._cycle_on()
            except Exception as error:
                # With one bus dead, the drives on another one would go on to their last targets.
                self._controller.abandon()
                if self._capture is not None and not self._controller.resting:
                    self._capture.update(str(error), resting=True)
                raise

    def _cycle_on(self) -> None:
        """Run cycles at absolute deadlines until the robot is at rest after its dismissal."""
        dt = self._controller.dt
        deadline = last = self._clock.monotonic()
        while True:
            now = self._clock.monotonic()
            order = self._cycle(now, min(max(now - last, dt / 2), 3 * dt))
            last = now
            if order.leave and self._controller.resting:
                return
            deadline += dt
            rest = deadline - self._clock.monotonic()
            if rest < -_LATE * dt:
                self._overruns += 1
                deadline = self._clock.monotonic()
            self._pause(max(0.0, rest))

    def _cycle(self, now: float, dt: float) -> Order:
        """Run one cycle and return the order that it followed."""
        controller = self._controller
        controller.begin(now)
        self._gather(now + _GATHER * controller.dt)
        self._incomplete += not controller.complete()
        order = self._exchange.order()
        if self._orphan:
            order = Order(leave=True, alive=now, stop=order.stop, activity=order.activity)
        controller.finish(self._clock.monotonic(), dt, order)
        end = self._clock.monotonic()
        self._count(end, end - now)
        self._exchange.put(self._captured(controller.state(end, self._timing())))
        if self._relay is not None:
            self._relay.end_cycle(wanted=order.frames)
        if self._moved is not None:
            self._moved(dt)
        return order

    def _captured(self, state: DogState) -> DogState:
        """Return the state, with the path of the capture file of its fault."""
        if self._capture is None or state.fault in MEANT:
            return state
        path = self._capture.update(state.fault, resting=self._controller.resting)
        return msgspec.structs.replace(state, capture=path) if path else state

    def _gather(self, until: float) -> None:
        """Receive from all buses until every drive has answered, or the time is up."""
        controller = self._controller
        while True:
            for name, bus in self._buses.items():
                left = until - self._clock.monotonic()
                for frame in bus.receive(0.0 if controller.complete() else max(0.0, min(left, _WAIT))):
                    controller.handle_frame(name, frame, self._clock.monotonic())
            if controller.complete() or self._clock.monotonic() >= until or self._moved is not None:
                return

    def _pause(self, seconds: float) -> None:
        """Wait for the next cycle; notice a dismissal, or the death of the adapter's process."""
        watched = [] if self._owner is None or self._orphan else [self._owner]
        ready, _, _ = select.select(watched, [], [], seconds)
        if not ready or self._owner is None:
            return
        if os.read(self._owner, 256):
            self._dismissed = True
            return
        if not self._dismissed:
            log.warning("the process that sends orders is gone: the dog sits down")
        self._orphan = True

    def _count(self, now: float, took: float) -> None:
        """Update the statistics of the last second."""
        self._cycles += 1
        since, cycles, worst = self._window
        self._window = (since or now, cycles + 1, max(worst, took))
        if now - self._window[0] >= 1.0:
            self._rate = self._window[1] / (now - self._window[0])
            self._worst = self._window[2]
            self._window = (now, 0, 0.0)

    def _timing(self) -> LoopTiming:
        """Return the timing statistics."""
        return LoopTiming(
            realtime=self._priority,
            rate=self._rate,
            cycles=self._cycles,
            overruns=self._overruns,
            incomplete=self._incomplete,
            worst=self._worst,
            age=min(self._controller.oldest, 1e6),
            clamped=self._controller.clamped,
            dropped=sum(getattr(bus, "dropped", 0) for bus in self._buses.values()),
        )
