import contextlib
import fcntl
import json
import os
import pty
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from fleet.model.state import EdgeState, RobotState
from fleet.model.summary import Summary, encode
from tests.tools.command_line import run_main
from tests.tools.waiting import DEADLINE

TOY = """
from typing import Annotated, Literal

from msgspec import Meta

from fleet import AdapterConfig, FrameAdapter, command


class ToyConfig(AdapterConfig):
    adapter: Literal["toy"]
    link: str


class Toy(FrameAdapter[ToyConfig]):
    Config = ToyConfig

    def drive(self, velocity):
        return ()

    @command("beep")
    def beep(self, *, seconds: Annotated[float, Meta(ge=1, le=30, extra={"unit": "s"})] = 1.0):
        '''Sound the horn.'''
        return ()

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"halt",)
"""
FLEET = """\
edge: {id: yard-1}
plugins: [plugins]
robots:
  - name: rex
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: toy
    link: sim:toy
"""


class Result(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def place(tmp_path, monkeypatch, shared_probes):
    """Make a folder with a good fleet.yaml and a toy adapter; the current one for the time of the test."""
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "toy.py").write_text(TOY)
    (tmp_path / "fleet.yaml").write_text(FLEET)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


@pytest.fixture
def fleet(place, capsys):
    """Run one command line in the folder."""

    def fleet(*arguments):
        code = run_main(arguments)
        return Result(code, *capsys.readouterr())

    return fleet


@pytest.fixture
def runtime(monkeypatch):
    """Make a folder for the sockets of edges, and let commands look there."""
    path = Path(tempfile.mkdtemp(prefix="fc"))
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(path))
    yield path
    shutil.rmtree(path)


class PlayedEdge:
    """An edge as commands see it: its bus, and robots that answer as the test says."""

    def __init__(self, runtime, edge, robots, groups, settings, *, places=None):
        self.edge = edge
        self.stops = []
        self._silent = False
        self._put_off = []
        self._states = {}
        self._stands = set()  # who shows that it was stopped
        self.shows_stops = True
        self._groups = groups
        self._robots = list(robots)
        self.bus = open_edge(BusSettings(edge, **settings), runtime)
        self._control = self.bus.control
        for name, fields in robots.items():
            self.add_robot(name, **fields)
        health = msgspec.json.encode(EdgeState(edge, "1.0", 0.0, 5.0, groups=groups, places=places or {}))
        self._control.declare_queryable(keys.health(edge), self._replier(health))
        self._control.declare_queryable(keys.stop(edge), self._stopped)
        self._control.token(keys.edge(edge))
        # Who joined before the answers were declared has asked in vain; an edge publishes both every second.
        self._control.put(keys.health(edge), health)
        for name in robots:
            self.publish_state(name)

    def add_robot(self, name, **fields):
        """Tell a robot's state."""
        twin, stamp = fields.pop("twin", ""), fields.pop("stamp", 1.0)
        state = RobotState(name, twin, "toy", self.edge, stamp, **fields)

        def encoded_state():
            known = name in self._stands and "last_command" not in fields
            ended = {"emergency_stop": True, "last_command": "emergency_stop", "last_outcome": "done"}
            return msgspec.json.encode(msgspec.structs.replace(state, **ended) if known else state)

        self._control.declare_queryable(keys.state(self.edge, name), self._replier(encoded_state))
        self._states[name] = encoded_state

    def publish_state(self, name):
        """Publish a robot's state, as an edge does once a second."""
        self._control.put(keys.state(self.edge, name), self._states[name]())

    def answer_garbage(self, name):
        """Answer for a robot with what is no state."""
        self._control.declare_queryable(keys.state(self.edge, name), self._replier(b"garbage"))

    def tells(self, key, value):
        """Answer a question on a key with a value."""
        self._control.declare_queryable(key, self._replier(msgspec.json.encode(value)))

    def publish_summary(self, *troubles, site="", robots=None, version="1.0", publish=False):
        """Tell a summary to whoever asks, and publish it once if that is wanted."""
        summary = Summary(
            self.edge, version, time.time(), 5.0, site, robots=robots or {"ok": 20}, troubles=troubles
        )
        if publish:
            self._control.put(keys.summary(self.edge), encode(summary))
        else:
            self._control.declare_queryable(keys.summary(self.edge), self._replier(encode(summary)))
        return self

    def sees(self, other):
        """Wait until another edge is seen."""
        seen = threading.Event()
        self._control.watch_tokens(keys.edge(other), lambda _key, alive: alive and seen.set())
        assert seen.wait(DEADLINE), f"{other} was not seen"

    def go_silent(self):
        """Answer nothing from now on but stops."""
        self._silent = True

    def answers(self, name, *replies):
        """Let a robot answer what it is asked; returns what it was."""
        requested = []

        def answer(question):
            requested.append(question)
            for reply in replies:
                question.reply(msgspec.json.encode(reply))
            question.close()

        self._control.declare_queryable(keys.command(self.edge, name), answer, more=keys.SENDER_SUFFIX)
        return requested

    def answers_late(self, name, *replies):
        """Let a robot answer what it is asked, with the last only when states are looked at after that."""

        def answer(question):
            for reply in replies[:-1]:
                question.reply(msgspec.json.encode(reply))
            self._put_off.append((question, msgspec.json.encode(replies[-1])))

        self._control.declare_queryable(keys.command(self.edge, name), answer)

    def answers_together(self, replies):
        """Let robots answer once all of them were asked; returns what they were."""
        requested, lock = [], threading.Lock()

        def answer(question):
            with lock:
                requested.append(question)
                if len(requested) < len(replies):
                    return
            for one in requested:
                one.reply(msgspec.json.encode(replies[one.key.split("/")[3]]))
                one.close()

        for name in replies:
            self._control.declare_queryable(keys.command(self.edge, name), answer)
        return requested

    def _replier(self, answer):
        def tell(question):
            if not self._silent:
                question.reply(answer() if callable(answer) else answer)
            question.close()
            while self._put_off:
                late, reply = self._put_off.pop()
                late.reply(reply)
                late.close()

        return tell

    def _stopped(self, question):
        names = json.loads(question.payload)
        self.stops.append(names)
        meant = {robot for name in names for robot in (name, *self._groups.get(name, ()))}
        stopped = [name for name in self._robots if not names or name in meant]
        if self.shows_stops:
            self._stands.update(stopped)
        question.reply(json.dumps(stopped).encode())
        question.close()


@pytest.fixture
def play_edge(runtime):
    """Play an edge, as many as needed."""
    with contextlib.ExitStack() as stack:

        def play_edge(edge, *, robots=None, groups=None, places=None, **settings):
            played = PlayedEdge(runtime, edge, robots or {}, groups or {}, settings, places=places)
            stack.callback(played.bus.close)
            return played

        yield play_edge


@pytest.fixture
def spawn_edge(runtime):
    """Start a process whose bus is that of an edge, and that answers nothing."""
    script = (
        "import sys; from pathlib import Path; from fleet.bus.bus import open_edge; "
        "from fleet.bus.settings import BusSettings; "
        "bus = open_edge(BusSettings(sys.argv[2]), Path(sys.argv[1])); "
        "print('up', flush=True); sys.stdin.read()"
    )
    with contextlib.ExitStack() as stack:

        def spawn_edge(edge):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", script, str(runtime), edge],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            stack.callback(process.kill)
            assert process.stdout.readline() == "up\n"
            return process

        yield spawn_edge


class Terminal:
    """A program on a terminal of its own; what it wrote is in ``text``."""

    def __init__(self, command, columns, lines, environ):
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
        self._process = subprocess.Popen(
            command,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env=kept | {"TERM": "xterm"} | environ,
            start_new_session=True,
        )
        os.close(theirs)
        self.text = ""

    def reads(self, awaited="", within=DEADLINE):
        """Read until some text was written, or to the end without one; returns all there is."""
        end = time.monotonic() + within
        while not awaited or awaited not in self.text:
            ready, _, _ = select.select([self._ours], [], [], max(0.0, end - time.monotonic()))
            assert ready, f"{awaited or 'its end'!r} did not come: {self.text!r}"
            try:
                data = os.read(self._ours, 65536)
            except OSError:  # EIO: nobody has the terminal any more
                data = b""
            if not data:
                assert not awaited, f"it ended without {awaited!r}: {self.text!r}"
                return self.text
            self.text += data.decode(errors="replace").replace("\r\n", "\n")
        return self.text

    def interrupt(self):
        """Press Ctrl-C."""
        os.kill(self._process.pid, signal.SIGINT)

    def ended(self):
        """Return its exit code."""
        self.reads()
        return self._process.wait(DEADLINE)

    def close(self):
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        os.close(self._ours)


@pytest.fixture
def terminal(place):
    """Run ``fleet`` on a terminal of its own, in the folder."""
    with contextlib.ExitStack() as stack:

        def terminal(*arguments, columns=80, lines=24, command=(sys.executable, "-m", "fleet"), **environ):
            started = Terminal([*command, *arguments], columns, lines, environ)
            stack.callback(started.close)
            return started

        yield terminal
