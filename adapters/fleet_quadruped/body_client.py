"""The adapter's side of the body controller: orders go out, states come in and are waited for."""

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
    """Orders to a body controller, and its newest ``state``. ``lamp``: what was asked of the lamp before."""

    def __init__(self, robot: Robot, *, lamp: bool | None) -> None:
        self.order = Order(lamp=lamp)
        self.state = DogState()
        self.process: BodyProcess
        self._robot = robot
        self._ordering = threading.Lock()  # halts come from other threads; held for an instant
        self._recorded: Callable[[], bool] = lambda: False
        self._dt = 0.0  # s of a cycle
        self._heard = 0.0  # monotonic s: the newest state, or the start
        self._news = asyncio.Event()
        self._one_request = asyncio.Lock()

    def begin(self, process: BodyProcess, dt: float, *, recorded: Callable[[], bool] = lambda: False) -> None:
        """Begin with a process that has started; ``dt``: seconds of one of its cycles.

        ``recorded`` says whether somebody records the frames of its buses.
        """
        self._recorded = recorded
        self.process, self._dt, self._heard = process, dt, self.now()
        self.send()

    def now(self) -> float:
        """Return monotonic seconds, which are the same in the body controller's process."""
        return self._robot.clock.monotonic()

    def send(self) -> None:
        """Send the newest order again; that it is fresh is what keeps the dog walking."""
        self.change({})

    def change(self, changes: Mapping[str, object], *, stops: int = 0, halts: int = 0) -> None:
        """Change and send the order, whole, from any thread; so many stops are added."""
        with self._ordering:
            counted = {"stop": self.order.stop + stops, "halts": self.order.halts + halts}
            frames = self._recorded()
            self.order = msgspec.structs.replace(
                self.order, **changes, **counted, alive=self.now(), frames=frames
            )
            self.process.orders.put(self.order)

    def look(self) -> None:
        """Take the newest state; raises LinkLost when the body controller tells none any more."""
        before = self.state
        self.state = self.process.states.get()
        self._check_alive()
        if self.state is not before and self.state.stamp:  # before the first state nothing is known
            self._news.set()
            health = health_of(self.state, 1.0 / self._dt)
            if before.stamp == 0.0 or health != health_of(before, 1.0 / self._dt):
                self._robot.health(health)

    def _check_alive(self) -> None:
        """Say at once that the body controller is frozen, and end the run; raises LinkLost."""
        self._heard = max(self._heard, self.state.stamp)
        silent = self.now() - self._heard
        if silent > _SILENT:
            cause = f"the body controller is frozen: it has told nothing for {silent:.1f} s"
            self._robot.health(Health(Level.OFFLINE, cause))
            raise LinkLost(cause)

    async def request(self, ask: BodyRequest, value: float = 0.0) -> None:
        """Ask the body for something; raises Refused with its reason."""
        async with self._one_request:
            number = self.order.activity.number + 1
            self.change({"activity": Activity(number, ask, value)})
            await self.until(lambda: self.state.answered >= number, ask.value)
            if self.state.refusal:
                raise Refused(self.state.refusal)

    async def reach(self, modes: Collection[str], what: str, within: float) -> None:
        """Wait until the dog was seen in one of some modes; raises Fault when it went off instead."""
        await self.until(lambda: self.state.mode in modes or self.state.mode in _OFF, what, within=within)
        if self.state.mode in _OFF:
            raise Fault(self.state.fault or f"it is {self.state.mode}")

    async def until(self, condition: Callable[[], bool], what: str, within: float = 2.0) -> None:
        """Wait for a state; raises TimedOut."""
        try:
            async with asyncio.timeout(within):
                while not condition():
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            raise TimedOut(f"{what}: the dog is {self.state.mode} after {within:g} s") from None
