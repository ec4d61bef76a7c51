"""``python -m fleet_quadruped.control PLAN``: the body controller process, started by the adapter."""

from __future__ import annotations

import contextlib
import logging
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fleet import (
    CanBus,
    Clock,
    ConfigError,
    LinkError,
    LinkLost,
    LinkRefused,
    OpenCanBus,
    SystemClock,
    decode_json,
)
from fleet_quadruped.any_description import AnyBody, load_body
from fleet_quadruped.can.bus_guard import require_sole_controller
from fleet_quadruped.can.capture import Capture, Captured
from fleet_quadruped.can.relay import RelaySender
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.exchange import SharedValue
from fleet_quadruped.control.loop import ControlLoop
from fleet_quadruped.control.orders import DogState, Order
from fleet_quadruped.control.task import ControlTask, StatusMessage
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.selfwalk.controller import SelfWalkController
from fleet_quadruped.sim.simulated_machine import SimulatedMachine, on_buses

_FOR_THE_PARENT = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)
"""Signals sent to a whole terminal or service; this process ends when its parent dismisses it or dies."""


class Memory:
    """Exchange through the shared memory of the plan."""

    def __init__(self, plan: ControlTask) -> None:
        self._orders = SharedValue(plan.order, Order)
        self._states = SharedValue(plan.state, DogState)

    def order(self) -> Order:
        """Return the newest order."""
        return self._orders.get()

    def put(self, state: DogState) -> None:
        """Publish a new state."""
        self._states.put(state)


def main(arguments: list[str]) -> int:
    """Run until dismissed; return the exit status."""
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("canopen").setLevel(logging.WARNING)
    logging.getLogger("can.interfaces.socketcand").setLevel(logging.ERROR)  # it warns of each split read
    for number in _FOR_THE_PARENT:
        signal.signal(number, signal.SIG_IGN)
    plan = decode_json(arguments[0], ControlTask)
    try:
        _run(plan, SystemClock())
    except (LinkError, ConfigError) as error:
        _send(
            StatusMessage(lost=str(error))
            if isinstance(error, LinkLost)
            else StatusMessage(refused=str(error))
        )
        return 1
    return 0


def _run(plan: ControlTask, clock: Clock) -> None:
    """Open the buses, configure the drives, announce readiness, and run the cycles to the end."""
    body = load_body(Path(plan.body))
    with contextlib.ExitStack() as stack:
        machine: SimulatedMachine | None = None
        if plan.sim:
            machine, simulated = on_buses(body, plan.sim)
            buses: dict[str, CanBus] = dict(simulated)
            _begin(machine, plan.faults)
        else:
            buses = {
                name: stack.enter_context(_opened(name, url, body, clock)) for name, url in plan.buses.items()
            }
        relay = _relay(plan.relay, stack)
        capture = Capture(buses, Path(plan.captures), clock, relay.add if relay else _discard)
        stack.callback(capture.finish)
        buses = capture.buses
        controller = (
            Controller(body, buses) if isinstance(body, DogDescription) else SelfWalkController(body, buses)
        )
        if machine is None:
            require_sole_controller(buses, controller.addresses, clock)
        controller.configure()
        _send(StatusMessage(ready=True))
        moved = machine.advance if machine else None
        owner = sys.stdin.fileno()
        ControlLoop(
            controller, buses, Memory(plan), clock, owner=owner, moved=moved, capture=capture, relay=relay
        ).run()


def _relay(descriptor: int, stack: contextlib.ExitStack) -> RelaySender | None:
    """Return the sender of frames to a recorder; None without a descriptor (-1)."""
    if descriptor < 0:
        return None
    return RelaySender(stack.enter_context(socket.socket(fileno=descriptor)))


def _discard(_captured: Captured) -> None:
    """Discard a frame: there is no relay."""


def _begin(machine: SimulatedMachine, faults: dict[str, float]) -> None:
    """Activate the faults of a simulated robot; raises LinkRefused for an unknown one."""
    for name, value in faults.items():
        try:
            machine.fault(name, value)
        except ValueError as error:
            raise LinkRefused(str(error)) from None


@contextlib.contextmanager
def _opened(name: str, url: str, body: AnyBody, clock: Clock) -> Iterator[OpenCanBus]:
    """Open a bus for the duration of a block."""
    described = body.buses[name]
    bus = OpenCanBus(name, url, described.bitrate, clock, described.data_bitrate)
    try:
        yield bus
    finally:
        bus.close()


def _send(message: StatusMessage) -> None:
    sys.stdout.buffer.write(msgspec.json.encode(message) + b"\n")
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
