"""Server of all simulated robots of one process: JSON lines in, one answer line for each.

    {"add": {...}}                                             -> {"url": "udpout:127.0.0.1:40001"}
    {"fault": {"url": "...", "name": "loss", "value": 0.05}}   -> {}    (value null ends it)
    {"look": {"url": "..."}}                                   -> {"x": 0.1, ...}    (the true state)
    {"remove": {"url": "..."}}                                 -> {}

A failed request is answered by ``{"error": "reason"}``.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
from abc import ABC, abstractmethod
from typing import ClassVar, Generic, Protocol, TypeVar

import msgspec

from fleet.runtime.decoding import decode_json

SpecT = TypeVar("SpecT")


class SimulatedRobot(Protocol):
    """One simulated robot; ``url`` is the link that reaches it."""

    url: str

    def step(self) -> None:
        """Simulate up to the present time."""

    def fault(self, name: str, value: float | None) -> None:
        """Start a fault, or end it (None); raises ValueError for an unknown fault."""

    def true_state(self) -> dict[str, float]:
        """Return the true position and state."""

    def close(self) -> None:
        """Remove the robot and its link."""


RobotT = TypeVar("RobotT", bound=SimulatedRobot)


class _RobotRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A request about the robot behind ``url``."""

    url: str
    name: str = ""
    value: float | None = 1.0


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One request line: exactly one field is set."""

    add: msgspec.Raw = msgspec.Raw()
    fault: _RobotRequest | None = None
    look: _RobotRequest | None = None
    remove: _RobotRequest | None = None


class SimServer(ABC, Generic[SpecT, RobotT]):
    """The simulated robots of this process, by URL. ``tick``: s between two steps of all robots."""

    Spec: type[SpecT]
    tick: ClassVar[float] = 0.02

    def __init__(self) -> None:
        self.robots: dict[str, RobotT] = {}

    @abstractmethod
    async def make(self, spec: SpecT) -> RobotT:
        """Create a robot; raises ValueError for an invalid specification, OSError if its port is in use."""

    async def add(self, spec: SpecT) -> RobotT:
        """Create a robot and start to simulate it; raises like ``make``."""
        return self.add_robot(await self.make(spec))

    def add_robot(self, robot: RobotT) -> RobotT:
        """Simulate a robot from now on."""
        self.robots[robot.url] = robot
        return robot

    async def answer(self, line: bytes) -> bytes:
        """Execute one request line; return the answer line, with its newline."""
        try:
            result = await self._carry_out(decode_json(line, _Line))
        except (ValueError, OSError) as error:
            result = {"error": str(error)}
        return msgspec.json.encode(result) + b"\n"

    async def _carry_out(self, request: _Line) -> dict[str, object]:
        """Execute one request; raises ValueError or OSError."""
        if request.add:
            return {"url": (await self.add(decode_json(request.add, self.Spec))).url}
        if request.fault is not None:
            self._robot(request.fault).fault(request.fault.name, request.fault.value)
            return {}
        if request.look is not None:
            return {**self._robot(request.look).true_state()}
        if request.remove is not None:
            self._robot(request.remove).close()
            del self.robots[request.remove.url]
            return {}
        raise ValueError("say one of add, fault, look and remove")

    def _robot(self, request: _RobotRequest) -> RobotT:
        """Return the robot of a request; raises ValueError if there is none."""
        if request.url not in self.robots:
            raise ValueError(f"there is no simulated robot at {request.url}")
        return self.robots[request.url]

    async def run(self) -> None:
        """Simulate all robots until cancelled; then close them."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        try:
            while True:
                for robot in list(self.robots.values()):
                    robot.step()
                due = max(due + self.tick, loop.time())
                await asyncio.sleep(due - loop.time())
        finally:
            for robot in self.robots.values():
                robot.close()

    async def serve(self, *, obeys: bool) -> None:
        """Run until SIGINT or SIGTERM; ``obeys``: execute the lines of stdin, and end when it closes.

        Writes the URLs of the robots that exist at the start to stdout.
        """
        loop = asyncio.get_running_loop()
        ended = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, ended.set)
        for url in self.robots:
            _write_line(msgspec.json.encode({"url": url}) + b"\n")
        tasks = [loop.create_task(self.run()), loop.create_task(ended.wait())]
        if obeys:
            tasks.append(loop.create_task(self._obey_stdin()))
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task

    async def _obey_stdin(self) -> None:
        """Execute the lines of stdin until it closes."""
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader()
        transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
        try:
            while line := await reader.readline():
                _write_line(await self.answer(line))
        finally:
            transport.close()


def _write_line(line: bytes) -> None:
    """Write one line to stdout."""
    sys.stdout.buffer.write(line)
    sys.stdout.buffer.flush()
