import contextlib
import json
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from tests.tools.waiting import DEADLINE

EDGE = """
import json, sys
from pathlib import Path
from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
given = json.loads(sys.argv[2])
for name in ("listen", "connect"):
    if given.get(name) is not None:
        given[name] = tuple(given[name])
bus = open_edge(BusSettings(**given), Path(sys.argv[1]))
bus.control.token("fleet/" + given["edge"])
print("up", flush=True)
sys.stdin.read()
bus.close()
"""
SLOW_READER = """
import sys, threading
from pathlib import Path
from fleet.bus.bus import join
from fleet.bus.settings import BusSettings
bus = join(BusSettings("yard"), Path(sys.argv[1]))
def read(key, payload):
    print("report", flush=True)
    threading.Event().wait()
bus.reports.subscribe("cw/**", read)
bus.control.subscribe("fleet/yard/stop", lambda key, payload: print("stop", payload.decode(), flush=True))
print("up", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def directory():
    """Make a folder whose path is short enough for sockets."""
    path = Path(tempfile.mkdtemp(prefix="fb"))
    yield path
    shutil.rmtree(path)


@pytest.fixture
def opened():
    """Close what the test opened, the newest first."""
    with contextlib.ExitStack() as stack:

        def opened(thing):
            stack.callback(thing.close)
            return thing

        yield opened


@pytest.fixture
def edge(directory, opened):
    """Open the bus of edge "yard", on its sockets alone."""
    return opened(open_edge(BusSettings("yard"), directory))


@pytest.fixture
def spawn(directory):
    """Start a process that prints "up" when it is."""
    with contextlib.ExitStack() as stack:

        def spawn(script, *arguments):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", script, str(directory), *arguments],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            stack.callback(process.kill)
            assert process.stdout.readline() == "up\n"
            return process

        yield spawn


@pytest.fixture
def spawn_edge(spawn):
    """Start a process that is an edge."""

    def spawn_edge(edge="yard", **settings):
        return spawn(EDGE, json.dumps({"edge": edge, **settings}))

    return spawn_edge


@pytest.fixture
def spawn_slow_reader(spawn):
    """Start a process that never gets done with its first report, and prints each stop."""
    return lambda: spawn(SLOW_READER)


@pytest.fixture
def sees():
    """Wait until a session sees a token."""

    def sees(bus_session, key):
        seen = threading.Event()
        bus_session.watch_tokens(key, lambda _key, alive: alive and seen.set())
        assert seen.wait(DEADLINE), f"{key} was not seen"

    return sees
