"""Factory of the simulated machine for either kind of description."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from fleet import CanFrame
from fleet_quadruped.any_description import AnyBody
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.sim.dog import SimDog
from fleet_quadruped.sim.lockstep import SimBus
from fleet_quadruped.sim.selfwalk import SimWalker
from fleet_quadruped.sim.worlds import make_world


class SimulatedMachine(Protocol):
    """A machine on simulated buses."""

    time: float

    def fault(self, name: str, value: float = 1.0) -> None:
        """Activate a fault."""

    def handle_frame(self, bus: str, frame: CanFrame) -> None:
        """Process a frame sent to the machine."""

    def advance(self, dt: float, *, sense: bool = True) -> None:
        """Advance by ``dt`` seconds."""


def simulated(body: AnyBody, world: str, heard: Mapping[str, Callable[[CanFrame], None]]) -> SimulatedMachine:
    """Return the machine; a self-walking machine has no physics in any world."""
    if isinstance(body, DogDescription):
        return SimDog(body, make_world(world, body), heard)
    return SimWalker(body, heard)


def on_buses(body: AnyBody, world: str) -> tuple[SimulatedMachine, dict[str, SimBus]]:
    """Return the machine and its buses, all in this process."""
    buses = {name: SimBus(name) for name in body.buses}
    machine = simulated(body, world, {name: bus.arrive for name, bus in buses.items()})
    for bus in buses.values():
        bus.connect(machine)
    return machine, buses
