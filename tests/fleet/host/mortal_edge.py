"""An edge in a process of its own that kills itself (SIGKILL) at a named step, for ``test_changes_killed``.

The processes are forked from one that has imported all this, and nothing else: importing it again for each
edge takes most of its processor time.
"""

import asyncio
import importlib
import multiprocessing
import os
import signal
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.host.edge.edge import Edge
from fleet.host.edge.last_configuration import FILE
from fleet.host.requests.stop_cause import local_cause
from fleet.spool.state_folder import state_folder

_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload([__name__])


def started(file: Path, runtime: Path, step: str) -> tuple[ForkServerProcess, Connection]:
    """Start an edge whose robot max is stopped; it sends a word when it is ready to be changed."""
    ours, theirs = _SERVER.Pipe(duplex=False)
    process = _SERVER.Process(target=_run, args=(file, runtime, step, theirs))
    process.start()
    theirs.close()
    return process, ours


def _run(file: Path, runtime: Path, step: str, ready: Connection) -> None:
    os.environ["FLEET_RUNTIME_DIR"] = str(runtime)  # the server has that of the first test
    asyncio.run(_main(file, runtime, step, ready))


async def _main(file: Path, runtime: Path, step: str, ready: Connection) -> None:
    edge = Edge(load(file), directory=runtime, clock=SystemClock())
    running = asyncio.create_task(edge.run(asyncio.Event()))
    written = state_folder(edge.process.edge, edge._config.edge.spool.path) / FILE
    while not (written.exists() and all(state.health == "ok" for state in edge.states())):  # noqa: ASYNC110
        await asyncio.sleep(0.05)
    await asyncio.to_thread(edge.process.stop_robots, ("max",), local_cause("", "test"))
    if step:
        module, _, name = step.partition(":")
        owner = importlib.import_module(module)
        *path, last = name.split(".")
        for part in path:
            owner = getattr(owner, part)
        assert hasattr(owner, last), step
        setattr(owner, last, lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL))
    ready.send("ready")
    await running
