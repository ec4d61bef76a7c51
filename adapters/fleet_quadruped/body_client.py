"""Client of the body controller: sends orders, receives states and waits for them."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Collection, Mapping

import msgspec

from fleet import Fault, Health, Level, LinkLost, Refused, Robot, TimedOut
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.orders import Activity, DogState, Order
from fleet_quadruped.process import BodyProcess
from fleet_quadruped.reports import health_of

_SILENT = 1.0  # s without a state after which the body controller counts as frozen
_OFF = frozenset({"off", "damped"})


class BodyClient:
    """Sends orders to a body controller, keeps its newest ``state``; ``lamp``: the last requested state."""

    def __init__(self, robot: Robot, *, lamp: bool | None) -> None:
        self.order = Order(lamp=lamp)
        self.state = DogState()
        self.process: BodyProcess
        self._robot = robot
        self._ordering = threading.Lock()  # halts come from other threads; the lock is held only briefly
        self._recorded: Callable[[], bool] = lambda: False
        self._dt = 0.0  # s: cycle time
        self._heard = 0.0  # monotonic s of the newest state, or of the start
        self._wakeup = asyncio.Event()
        self._one_request = asyncio.Lock()

    def begin(self, process: BodyProcess, dt: float, *, recorded: Callable[[], bool] = lambda: False) -> None:
        """Begin with a started process; ``dt``: its cycle time in s.

        ``recorded`` returns True while the frames of its buses are being recorded.
        """
        self._recorded = recorded
        self.process, self._dt, self._heard = process, dt, self.now()
        self.send()

    def now(self) -> float:
        """Return monotonic time in s; the body controller's process has the same clock."""
        return self._robot.clock.monotonic()

    def send(self) -> None:
        """Send the current order with a new time stamp; the robot stops walking when orders become old."""
        self.change({})

    def change(self, changes: Mapping[str, object], *, stops: int = 0, halts: int = 0) -> None:
        """Apply changes to the order and send it, from any thread.

        ``stops`` and ``halts`` are added to the order's counters.
        """
        with self._ordering:
            counted = {"stop": self.order.stop + stops, "halts": self.order.halts + halts}
            frames = self._recorded()
            self.order = msgspec.structs.replace(
                self.order, **changes, **counted, alive=self.now(), frames=frames
            )
            self.process.orders.put(self.order)

    def poll(self) -> None:
        """Read the newest state; raises LinkLost if the body controller sends no more states."""
        before = self.state
        self.state = self.process.states.get()
        self._check_alive()
        if self.state is not before and self.state.stamp:  # a stamp of 0: no state yet
            self._wakeup.set()
            health = health_of(self.state, 1.0 / self._dt)
            if before.stamp == 0.0 or health != health_of(before, 1.0 / self._dt):
                self._robot.health(health)

    def _check_alive(self) -> None:
        """Raise LinkLost if the body controller is frozen; report the health at once."""
        self._heard = max(self._heard, self.state.stamp)
        silent = self.now() - self._heard
        if silent > _SILENT:
            cause = f"the body controller is frozen: no state for {silent:.1f} s"
            self._robot.health(Health(Level.OFFLINE, cause))
            raise LinkLost(cause)

    async def request(self, request: BodyRequest, value: float = 0.0) -> None:
        """Send a request to the body and wait for its answer; raises Refused with the reason."""
        async with self._one_request:
            number = self.order.activity.number + 1
            self.change({"activity": Activity(number, request, value)})
            await self.until(lambda: self.state.answered >= number, request.value)
            if self.state.refusal:
                raise Refused(self.state.refusal)

    async def reach(self, modes: Collection[str], what: str, within: float) -> None:
        """Wait until the robot was seen in one of some modes; raises Fault if its drives went off instead."""
        await self.until(lambda: self.state.mode in modes or self.state.mode in _OFF, what, within=within)
        if self.state.mode in _OFF:
            raise Fault(self.state.fault or f"it is {self.state.mode}")

    async def until(self, condition: Callable[[], bool], what: str, within: float = 2.0) -> None:
        """Wait until a condition on the state holds; raises TimedOut after ``within`` s."""
        try:
            async with asyncio.timeout(within):
                while not condition():
                    self._wakeup.clear()
                    await self._wakeup.wait()
        except TimeoutError:
            raise TimedOut(f"{what}: the dog is {self.state.mode} after {within:g} s") from None
