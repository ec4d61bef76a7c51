"""``python -m fleet_ugv.sim``: simulated bases on pseudo-terminals.

With ``--stdin`` it takes the JSON lines of ``fleet_ugv.sim.server`` and ends when stdin closes.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import msgspec

from fleet.sim.faults import parse_faults
from fleet_ugv.sim.faults import FAULTS
from fleet_ugv.sim.server import SimServer
from fleet_ugv.sim.spec import BOARDS, SimSpec


def _parser() -> argparse.ArgumentParser:
    """Return the command line's form."""
    parser = argparse.ArgumentParser(prog="python -m fleet_ugv.sim", description=__doc__)
    parser.add_argument("--profile", choices=sorted(BOARDS), help="what the base is")
    parser.add_argument("--fault", default="", help=f"NAME:VALUE,... of {', '.join(sorted(FAULTS))}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stdin", action="store_true", help="take JSON lines; end when stdin closes")
    return parser


def _tell(line: bytes) -> None:
    """Write one line to stdout."""
    sys.stdout.buffer.write(line)
    sys.stdout.buffer.flush()


async def _obey_stdin(server: SimServer) -> None:
    """Carry out the lines of stdin until it closes."""
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    try:
        while line := await reader.readline():
            _tell(server.answer(line))
    finally:
        transport.close()


async def _serve(options: argparse.Namespace, folder: Path) -> None:
    """Run until a signal, or until stdin closes when it is obeyed."""
    server = SimServer(folder)
    if options.profile:
        spec = SimSpec(options.profile, options.seed, parse_faults(options.fault, FAULTS))
        _tell(msgspec.json.encode({"url": server.add(spec).url}) + b"\n")
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    tasks = [loop.create_task(server.run()), loop.create_task(ended.wait())]
    if options.stdin:
        tasks.append(loop.create_task(_obey_stdin(server)))
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulator; return the exit status (2: it was asked for something impossible)."""
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
