"""``python -m fleet_ugv.sim``: simulated bases on pseudo-terminals.

With ``--stdin`` it takes the JSON lines of ``fleet.sim.server`` and ends when stdin closes.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fleet.sim.faults import parse_faults
from fleet_ugv.sim.faults import FAULTS
from fleet_ugv.sim.server import Bases
from fleet_ugv.sim.spec import BOARDS, BaseSpec


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(prog="python -m fleet_ugv.sim", description=__doc__)
    parser.add_argument("--profile", choices=sorted(BOARDS), help="what the base is")
    parser.add_argument("--fault", default="", help=f"NAME:VALUE,... of {', '.join(sorted(FAULTS))}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stdin", action="store_true", help="take JSON lines; end when stdin closes")
    return parser


async def _serve(options: argparse.Namespace, folder: Path) -> None:
    """Run the bases; raises ValueError for an invalid specification."""
    server = Bases(folder)
    if options.profile:
        await server.add(BaseSpec(options.profile, options.seed, parse_faults(options.fault, FAULTS)))
    await server.serve(obeys=options.stdin)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulator; return the exit status (2: invalid arguments)."""
    options = _parser().parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="fleet-ugv-") as folder:
        try:
            asyncio.run(_serve(options, Path(folder)))
        except (ValueError, OSError) as error:
            sys.stderr.write(f"fleet_ugv.sim: {error}\n")
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
