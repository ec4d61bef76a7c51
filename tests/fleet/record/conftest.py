"""A played edge to record, and files of recordings read back by the reader of the mcap package."""

import contextlib
import shutil
import tempfile
from pathlib import Path

import pytest
from mcap.reader import make_reader


@pytest.fixture
def runtime(monkeypatch):
    """Make a folder for the sockets of edges, and let all look there."""
    path = Path(tempfile.mkdtemp(prefix="fc"))
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(path))
    yield path
    shutil.rmtree(path)


@pytest.fixture
def play_edge(runtime, module_at):
    """Play an edge, as many as needed."""
    played_edge = module_at("fleet/cli/conftest.py").PlayedEdge
    with contextlib.ExitStack() as stack:

        def play_edge(edge, *, robots=None, **settings):
            played = played_edge(runtime, edge, robots or {}, {}, settings)
            stack.callback(played.bus.close)
            return played

        yield play_edge


@pytest.fixture
def read_back():
    """Read a file, or the files of a folder: (topic, name of the schema, message) of each message."""

    def read_back(path):
        found = []
        for file in [path] if path.suffix else sorted(path.glob("*.mcap")):
            with file.open("rb") as stream:
                found += [
                    (channel.topic, schema.name, message)
                    for schema, channel, message in make_reader(stream).iter_messages()
                ]
        return found

    return read_back
