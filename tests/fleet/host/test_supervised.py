"""``fleet run`` from outside, when its processes die: who halts the robots, and what becomes of stops."""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import psutil
import pytest

from fleet.bus import keys
from fleet.errors import BusError
from fleet.supervisor.sockets import users
from fleet.supervisor.stop_request import stop_all
from tests.tools.waiting import wait_until

CART = '''
"""A cart without a watchdog of its own: it drives on until it is told something else."""
import os, signal
from typing import Literal
import fleet


class CartConfig(fleet.AdapterConfig):
    adapter: Literal["cart"]
    journal: str
    link: fleet.LinkText


class Cart(fleet.FrameAdapter[CartConfig]):
    Config = CartConfig
    limits = fleet.Limits(speed=2.0, yaw_rate=1.0)
    silence = 0.0

    def drive(self, velocity):
        yield b"drive %g\\n" % velocity.linear.x

    def decode(self, frame, stamp):
        return ()

    def hello(self):
        yield b"process %d\\n" % os.getpid()

    def halt(self):
        yield b"halt\\n"

    @fleet.command("freeze", moves=False)
    def freeze(self):
        os.kill(os.getpid(), signal.SIGSTOP)
        return ()
'''
MOVE = b'{"command": "move_forward", "data": {"linear_x": 1.0}}'
ZERO = b'{"command": "move_forward", "data": {"linear_x": 0.0}}'
RELEASE = b'{"command": "release_emergency_stop"}'
KINDS = ("tcp", "udp")


class Cart:
    """The cart's own end of its link: what it was told, with the monotonic second."""

    def __init__(self, kind):
        self.lines = []
        self.kind = kind
        self._socket = socket.socket(type=socket.SOCK_STREAM if kind == "tcp" else socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        if kind == "tcp":
            self._socket.listen()
        self.link = f"{'tcp' if kind == 'tcp' else 'udpout'}:127.0.0.1:{self._socket.getsockname()[1]}"
        threading.Thread(target=self._serve if kind == "tcp" else self._hear, daemon=True).start()

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                threading.Thread(target=self._lines, args=(connection,), daemon=True).start()

    def _lines(self, connection):
        with connection, connection.makefile("rb") as lines, contextlib.suppress(OSError):
            for line in lines:
                self._take(line)

    def _hear(self):
        with contextlib.suppress(OSError):
            while True:
                self._take(self._socket.recv(1000))

    def _take(self, data):
        self.lines += [(time.monotonic(), line.decode()) for line in data.splitlines()]

    @property
    def words(self):
        return [word for _, word in self.lines]

    @property
    def process(self):
        """The process that has it."""
        return next((int(word.split()[1]) for word in reversed(self.words) if word.startswith("process")), 0)

    @property
    def moves(self):
        return bool(self.lines) and self.words[-1].startswith("drive 1")

    def close(self):
        self._socket.close()


class Run:
    """``fleet run`` of a yard with one cart; ``errors`` are its lines on stderr."""

    def __init__(self, place, cart):
        self.place, self.cart = place, cart
        command = [sys.executable, "-m", "fleet", "run", str(place.file)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.errors = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stderr:
            self.errors.append(line)

    def end(self):
        """End it in order, and what is left of it by force."""
        family = [self.process.pid] if self.process.poll() is None else []
        family += [each.pid for pid in family for each in psutil.Process(pid).children(recursive=True)]
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(60)
        for pid in family:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()
        self._reader.join()
        self.process.stderr.close()

    @property
    def edge(self):
        """The edge's own process."""
        (edge,) = psutil.Process(self.process.pid).children()
        return edge

    def ready(self, after=0):
        """Wait until the robot can be driven, by another process than ``after``."""
        wait_until("the cart is greeted", lambda: self.cart.process not in (0, after))
        wait_until("the edge answers", self._answers)

    def _answers(self):
        try:
            with contextlib.closing(self.place.bus_session()) as bus_session:
                return list(bus_session.request(keys.health(self.place.id), b"", timeout=2))
        except BusError:
            return False

    def request(self, message):
        """Ask the robot, as soon as it can be asked."""
        key = keys.command(self.place.id, "rex")
        with contextlib.closing(self.place.bus_session()) as bus_session:
            return wait_until(
                "an answer", lambda: [said for _, said in bus_session.request(key, message, timeout=60)]
            )

    def drive(self):
        """Drive the cart, so that it goes on by itself; return when it was last told so."""
        wait_until("it is driven", lambda: b'"accepted"' in b"".join(self.request(MOVE)) and self.cart.moves)

    def line(self, pattern):
        return wait_until(
            pattern, lambda: next((line for line in self.errors if re.search(pattern, line)), "")
        )


@pytest.fixture
def run(yard):
    """Start a yard with a cart, in the edge's own process or in a worker."""
    started = []

    def run(worker, kind="tcp"):
        cart = Cart(kind)
        place = yard(rex={"adapter": "cart", "worker": worker, "link": cart.link})
        plugins = place.file.parent / "plugins"
        (plugins / "toy.py").unlink()  # else each start of the edge would inspect it, too
        (plugins / "cart.py").write_text(CART)
        started.append(Run(place, cart))
        return started[-1]

    yield run
    for each in started:
        each.end()
        each.cart.close()


def gone(process):
    """Return True for a process that has ended, though nobody may have taken note of it."""
    try:
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:  # it ended in between
        return True


@pytest.mark.combinations
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("worker", ["main", "arm"])
def test_a_robot_without_a_watchdog_is_halted_when_its_process_is_killed_and_stopped_in_the_next(
    run, worker, kind
):
    """The stop needs no bus, also to a worker."""
    it = run(worker, kind)
    it.ready()
    first = it.cart.process
    it.drive()
    killed = time.monotonic()
    os.kill(first, signal.SIGKILL)
    later_words = lambda: [word for at, word in it.cart.lines if at > killed]  # noqa: E731
    wait_until("the halt", lambda: "halt" in later_words())
    assert not [
        word for word in later_words()[: later_words().index("halt")] if word.startswith("process")
    ], "its supervisor halts it: nothing waits until it is run again, which takes seconds"
    it.line("has died; halted: rex")
    if worker == "main":
        it.line("the edge ended .killed by SIGKILL.; restarting it")
    it.ready(after=first)
    assert not it.cart.moves
    it.drive()
    (answer,) = stop_all(it.place.runtime)
    assert (answer.names, answer.kept) == (("rex",), False)
    wait_until("it is told", lambda: not it.cart.moves)
    assert b"emergency stop is set" in it.request(MOVE)[0]


def test_an_edge_that_is_frozen_is_killed_its_robots_halted_and_a_stop_meanwhile_set_in_the_next(run):
    it = run("main")
    it.ready()
    first = it.edge
    assert first.pid == it.cart.process
    it.drive()
    first.suspend()
    it.line("the edge is frozen: killed; halted: rex")
    wait_until("the halt", lambda: "halt" in it.cart.words)
    wait_until("it is dead", lambda: gone(first))
    (answer,) = stop_all(it.place.runtime)
    it.ready(after=first.pid)
    (refused,) = it.request(MOVE)
    assert b"emergency stop is set" in refused
    assert answer.kept or answer.names == ("rex",), "in between the edge may be back already"


def test_a_stop_is_answered_by_the_edge_while_it_is_there_also_when_its_runtime_folder_was_removed(run):
    it = run("main")
    it.ready()
    it.drive()
    (answer,) = stop_all(it.place.runtime, ("rex",))
    assert (answer.names, answer.edge, answer.kept) == (("rex",), it.place.id, False)
    wait_until("it is told", lambda: not it.cart.moves)
    assert f"asked by {users()[os.getuid()]} (proven, on this computer)".encode() in it.request(MOVE)[0]
    assert b'"done"' in b"".join(it.request(RELEASE))
    it.request(ZERO)  # who drove lets go, then drives again
    it.drive()
    before = len(it.cart.words)
    shutil.rmtree(it.place.runtime)
    it.line("was removed, as at a logout; fleet stop reaches the supervisor")
    line = [sys.executable, "-m", "fleet", "stop", "--all"]
    said = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    assert f"the stop is set; not seen to stand yet: rex\nreached: edge {it.place.id}\n" in said.stderr
    assert "halt" in it.cart.words[before:]


def test_a_stop_of_an_edge_that_is_frozen_is_written_by_its_supervisor_and_kept(run):
    it = run("main")
    it.ready()
    it.drive()
    it.edge.suspend()
    (answer,) = stop_all(it.place.runtime)
    assert (answer.names, answer.kept) == (("rex",), True)
    wait_until("the halt", lambda: it.cart.words[-1] == "halt")
    line = [sys.executable, "-m", "fleet", "stop", "--all"]
    said = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    assert f"edge {it.place.id} is away: its stop is set when it is back; halted now: rex" in said.stdout


def test_an_edge_whose_supervisor_was_killed_ends_in_order(run):
    it = run("main")
    it.ready()
    edge = it.edge
    it.drive()
    it.process.kill()
    wait_until("the edge has ended", lambda: gone(edge))
    assert "halt" in it.cart.words[-5:]


def test_a_mistake_in_fleet_yaml_is_reported_once_and_nothing_is_started_again(yard):
    place = yard(rex={})
    place.file.write_text("edge: {id: 5}\nrobots: 7\n")
    ended = subprocess.run(
        [sys.executable, "-m", "fleet", "run", str(place.file)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert ended.returncode == 3
    assert "restarting it" not in ended.stderr
