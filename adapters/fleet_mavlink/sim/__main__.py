"""``python -m fleet_mavlink.sim``: simulated MAVLink vehicles on UDP or TCP."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

from fleet.sim.faults import parse_faults
from fleet_mavlink.sim.faults import FAULTS
from fleet_mavlink.sim.server import SocketAddress, Vehicles
from fleet_mavlink.sim.spec import VEHICLES, ZURICH, VehicleSpec, parse_home, parse_ready, spec_of


def _address(text: str) -> SocketAddress:
    """Return HOST:PORT."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise ValueError(f"{text!r} is not HOST:PORT")
    return host, int(port)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m fleet_mavlink.sim", description=__doc__)
    parser.add_argument("--flavour", choices=tuple(VEHICLES), default="ardupilot", help="the firmware")
    kinds = "; ".join(f"{flavour}: {', '.join(kinds)}" for flavour, kinds in VEHICLES.items())
    parser.add_argument("--vehicle", default="multirotor", help=f"what they are, of {kinds}")
    parser.add_argument("--vehicles", type=int, help="how many; left out: 1, with --stdin none")
    parser.add_argument("--system-id", type=int, default=1, help="of the first; the rest count on")
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--to", help="HOST:PORT to speak to, for all vehicles")
    group.add_argument("--port", type=int, help="first UDP port to wait on; the rest count on (free ones)")
    group.add_argument("--tcp", type=int, help="first TCP port to wait on; the rest count on")
    parser.add_argument("--home", default=",".join(map(str, ZURICH)), help="LAT,LON,ALT,HEADING")
    parser.add_argument("--spacing", type=float, default=5.0, help="metres between two vehicles")
    parser.add_argument("--ready-after", default="real", help="seconds until armable (as the real one)")
    parser.add_argument("--speed", type=float, default=1.0, help="seconds of simulation in a second")
    parser.add_argument("--fault", default="", help=f"NAME:VALUE,... of {', '.join(sorted(FAULTS))}")
    parser.add_argument("--with", dest="accessories", default="", help="gimbal,adsb,camera: more components")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--stdin", action="store_true", help="take JSON lines (fleet.sim.server); end with stdin"
    )
    return parser


def _specs(options: argparse.Namespace) -> list[VehicleSpec]:
    """Return the requested vehicles, in a row to the east; raises ValueError."""
    latitude, longitude, altitude, heading = parse_home(options.home)
    metres_per_degree = 75_000.0
    return [
        spec_of(
            {
                "flavour": options.flavour,
                "vehicle": options.vehicle,
                "system_id": options.system_id + place,
                "home": (
                    latitude,
                    longitude + place * options.spacing / metres_per_degree,
                    altitude,
                    heading,
                ),
                "ready": parse_ready(options.ready_after),
                "speed": options.speed,
                "faults": parse_faults(options.fault, FAULTS),
                "seed": options.seed,
                "accessories": tuple(filter(None, options.accessories.split(","))),
            }
        )
        for place in range(not options.stdin if options.vehicles is None else options.vehicles)
    ]


async def _serve(options: argparse.Namespace) -> None:
    """Open the sockets and run the vehicles; raises ValueError or OSError."""
    server = Vehicles()
    target = _address(options.to) if options.to else None
    for place, spec in enumerate(_specs(options)):
        if options.tcp is not None:
            await server.add_tcp(spec, options.tcp + place if options.tcp else 0)
        else:
            await server.add_udp(spec, target, options.port + place if options.port else 0)
    await server.serve(obeys=options.stdin)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulator; return the exit status (2: impossible arguments)."""
    options = _parser().parse_args(arguments)
    try:
        asyncio.run(_serve(options))
    except (ValueError, OSError) as error:
        sys.stderr.write(f"fleet_mavlink.sim: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
