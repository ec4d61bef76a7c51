"""``python -m fleet_quadruped.sim``: a simulated robot on real python-can buses, in real time.

    python -m fleet_quadruped.sim --bus a=can:udp_multicast:239.74.163.2?port=43113

The controller runs in another process and sees twelve drives, an IMU and a battery. Ends with the standard
input.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import select
import sys
from collections.abc import Mapping
from pathlib import Path

from fleet import Clock, FleetError, OpenCanBus, SystemClock
from fleet.sim.faults import parse_faults
from fleet_quadruped.any_description import load_body
from fleet_quadruped.control.loop import realtime
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim.faults import ALL_FAULTS, WALKER_FAULTS
from fleet_quadruped.sim.simulated_machine import SimulatedMachine, simulated
from fleet_quadruped.sim.worlds import WORLDS

log = logging.getLogger(__name__)

_STEP = 0.002  # s: control period inside the drives
_LATEST = 0.1  # s of delay to real time beyond which it is dropped


def main(arguments: list[str]) -> int:
    """Run until the standard input ends; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="fleet_quadruped.sim", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--body", type=Path, default=EXAMPLE, help="the dog's description")
    parser.add_argument(
        "--bus", action="append", required=True, metavar="NAME=URL", help="name and URL of a bus"
    )
    parser.add_argument("--world", choices=sorted(WORLDS), default="auto")
    parser.add_argument("--faults", default="", help=", ".join(ALL_FAULTS))
    given = parser.parse_args(arguments)
    clock = SystemClock()
    try:
        dog = load_body(given.body)
        with contextlib.ExitStack() as stack:
            buses: dict[str, OpenCanBus] = {}
            for name, _, url in (text.partition("=") for text in given.bus):
                buses[name] = OpenCanBus(
                    name, url, dog.buses[name].bitrate, clock, dog.buses[name].data_bitrate
                )
                stack.callback(buses[name].close)
            sim = simulated(dog, given.world, {name: bus.send for name, bus in buses.items()})
            for fault, value in parse_faults(given.faults, {**WALKER_FAULTS, **ALL_FAULTS}).items():
                sim.fault(fault, value)
            realtime()
            sys.stdout.write("ready\n")
            sys.stdout.flush()
            _serve(sim, buses, clock, dog.dt)
    except (FleetError, ValueError, KeyError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


def _serve(sim: SimulatedMachine, buses: Mapping[str, OpenCanBus], clock: Clock, sense_every: float) -> None:
    """Keep the simulation in step with real time."""
    began_at, sensed = clock.monotonic() - sim.time, sim.time
    while True:
        for name, bus in buses.items():
            for frame in bus.receive(0.0005):
                sim.handle_frame(name, frame)
        behind = clock.monotonic() - began_at - sim.time
        if behind > _LATEST:
            log.warning("the simulated dog is %.2f s late and lets them go", behind)
            began_at, behind = began_at + behind, 0.0
        while behind >= _STEP:
            due = sim.time + _STEP - sensed >= sense_every - 1e-9
            sim.advance(_STEP, sense=due)
            sensed = sim.time if due else sensed
            behind -= _STEP
        ready, _, _ = select.select([sys.stdin], [], [], 0.0)
        if ready and not os.read(sys.stdin.fileno(), 64):
            return


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
