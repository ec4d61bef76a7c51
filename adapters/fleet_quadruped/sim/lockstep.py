"""A simulated robot and its controller in one thread and one time: deterministic, faster than real time."""

from __future__ import annotations

import threading
from collections import deque
from typing import Protocol

from fleet import CanFrame, LinkLost
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.sim.dog import SimDog
from fleet_quadruped.sim.world import KinematicWorld, World


class FrameSink(Protocol):
    """A machine that receives frames."""

    def handle_frame(self, bus: str, frame: CanFrame) -> None:
        """Process a frame sent to the machine."""


class SimBus:
    """One bus of a simulated robot, in this process. ``cut`` makes it fail like an unplugged one."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.cut = False
        self.sent: deque[CanFrame] = deque(maxlen=64)
        self._dog: FrameSink | None = None
        self._arrived: deque[CanFrame] = deque()
        self._wakeup: threading.Event | None = None  # while a receiver waits

    def connect(self, dog: FrameSink) -> None:
        """Connect the robot."""
        self._dog = dog

    def arrive(self, frame: CanFrame) -> None:
        """Receive a frame from the robot."""
        if not self.cut:
            self._arrived.append(frame)
            wakeup = self._wakeup
            if wakeup is not None:
                wakeup.set()

    def send(self, frame: CanFrame) -> None:
        """Deliver a frame to the robot."""
        if self.cut or self._dog is None:
            return
        self.sent.append(frame)
        self._dog.handle_frame(self.name, frame)

    def receive(self, wait: float) -> list[CanFrame]:
        """Return the frames of the robot; waits for replies to another thread. Raises LinkLost if cut."""
        if wait > 0:
            self._wait(wait)
        if self.cut:
            raise LinkLost(f"bus {self.name!r} is gone")
        frames = []
        while self._arrived:
            frames.append(self._arrived.popleft())
        return frames

    def _wait(self, seconds: float) -> None:
        """Wait for a frame that answers another thread's request."""
        self._wakeup = wakeup = threading.Event()
        if not self._arrived:
            wakeup.wait(seconds)
        self._wakeup = None

    def close(self) -> None:
        """Disconnect the robot."""
        self._dog = None


def lockstep(
    dog: DogDescription, world: World | None = None, *, real: DogDescription | None = None, seed: int = 1
) -> tuple[SimDog, dict[str, SimBus]]:
    """Return a simulated robot and its buses; ``real``: its actual build if ``dog`` is wrong."""
    buses = {name: SimBus(name) for name in dog.buses}
    built = real or dog
    heard = {name: bus.arrive for name, bus in buses.items()}
    sim = SimDog(built, world or KinematicWorld(built), heard, seed)
    for bus in buses.values():
        bus.connect(sim)
    return sim, buses
