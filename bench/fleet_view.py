"""Cost of a fleet view of 500 edges with twenty robots each, and the time until it shows a fault.

The edges are puppets (``bench/summary_puppets.py``). Each declares its own token, and its summaries are made
and sent by the code of a real edge. Ten edges share a Zenoh session, as a site behind its router does, and
join one router over TCP. ``fleet top`` runs on a terminal of 120 columns and 40 lines, as for a user. A fault
counts as seen when its text is written to that terminal. The time includes the edge's poll of its robots, the
transport, and the drawing.
"""

import fcntl
import os
import pty
import select
import statistics
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path

import psutil

from bench.common import cpu_seconds, free_port, line

EDGES = 500
TOGETHER = 50  # edges per process
ROUNDS = 20
SETTLE = 8.0  # s until all edges have been drawn
MEASURED = 30.0  # s
WORDS = "abcdefghijklmnopqrstuvwxyz"


class Screen:
    """``fleet top`` on a pseudo-terminal, with its recent output."""

    def __init__(self, command, environment):
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        options = {"stdin": theirs, "stdout": theirs, "stderr": subprocess.DEVNULL, "env": environment}
        self.process = subprocess.Popen(command, **options, start_new_session=True)
        os.close(theirs)
        self.last = ""
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while True:
            try:
                select.select([self._ours], [], [])
                text = os.read(self._ours, 65536).decode(errors="replace")
            except OSError:
                return
            with self._changed:
                self.last = (self.last + text)[-40_000:]
                self._changed.notify_all()

    def seen(self, words, within=30.0):
        """Wait until ``words`` appear in the output, and return the monotonic time."""
        with self._changed:
            if not self._changed.wait_for(lambda: words in self.last, within):
                sys.exit(f"{words!r} was not shown: {self.last[-3000:]}")
            return time.monotonic()


class Puppets:
    """A process of puppet edges, or the router."""

    def __init__(self, *arguments):
        command = [sys.executable, "-m", "bench.summary_puppets", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def up(self):
        if self.process.stdout.readline() != "up\n":
            sys.exit("puppets did not start")
        return self

    def fault(self, edge, word):
        """Set the fault of an edge's first robot, or clear it with an empty word; return the time."""
        self.process.stdin.write(f"edge-{edge} {word}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def end(self):
        self.process.kill()
        self.process.wait()


def run():
    """Measure the view of a healthy fleet, then robot faults, then the loss of a computer with many edges."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    running = [Puppets("router", endpoint).up()]
    with tempfile.TemporaryDirectory(prefix="fv") as folder:
        try:
            for first in range(0, EDGES, TOGETHER):  # all at once would delay the router's replies
                running.append(Puppets(first, TOGETHER, endpoint).up())
            _measure(Path(folder), endpoint, running[0], running[1:])
        finally:
            for each in running:
                each.end()


def _measure(folder, endpoint, router, puppets):
    view = folder / "view.yaml"
    view.write_text(f"edge: {{id: view}}\nbus: {{connect: [{endpoint}], insecure: local}}\n")
    environment = os.environ | {"FLEET_RUNTIME_DIR": str(folder), "XDG_STATE_HOME": str(folder)}
    environment |= {"TERM": "xterm"}
    command = [sys.executable, "-m", "fleet", "top", "--fleet", "--no-color", "-f", str(view)]
    began = time.monotonic()
    screen = Screen(command, environment)
    try:
        took = screen.seen(f"{EDGES} edges: {EDGES} up; {EDGES * 20} robots: {EDGES * 20} ok") - began
        line(f"fleet top: {EDGES} edges on the screen after its start", f"{took:.1f} s")
        _cost(screen.process.pid, router.process.pid)
        _faults(screen, puppets)
        _deaths(screen, puppets)
    finally:
        screen.process.kill()
        screen.process.wait()


def _cost(pid, router):
    """Print processor time and memory of the view at rest."""
    time.sleep(SETTLE)
    memory = psutil.Process(pid).memory_info
    before, cpu, routed, began = memory().rss, cpu_seconds(pid), cpu_seconds(router), time.monotonic()
    time.sleep(MEASURED)
    spent = time.monotonic() - began
    line("fleet top: processor", f"{(cpu_seconds(pid) - cpu) / spent * 100:.1f} %", "(<= 20 % of a core)")
    line("the router: processor", f"{(cpu_seconds(router) - routed) / spent * 100:.1f} %")
    grown = (memory().rss - before) / 2**20
    line(
        f"fleet top: memory, and its growth in {MEASURED:g} s",
        f"{before / 2**20:.0f} + {grown:.1f} MiB",
        "(flat)",
    )


def _faults(screen, puppets):
    """Print the time from a robot's fault until its cause is on the screen."""
    waits = []
    for number in range(ROUNDS):
        edge = number * 37 % EDGES
        word = f"gears stuck {WORDS[number]}"
        process = puppets[edge // TOGETHER]
        at = process.fault(edge, word)
        waits.append(screen.seen(f"{word} <- edge-{edge}") - at)
        process.fault(edge, "")
    line(f"a robot's fault on the screen, median of {ROUNDS}", f"{statistics.median(waits):.2f} s")
    line("a robot's fault on the screen, worst", f"{max(waits):.2f} s", "(<= 2 s)")


def _deaths(screen, puppets):
    """Print the time from the end of a computer with many edges until the screen shows them gone."""
    at = time.monotonic()
    puppets[0].end()
    line(
        f"{TOGETHER} edges gone at once, on the screen",
        f"{screen.seen(f'{TOGETHER} edges gone') - at:.2f} s",
        "(<= 2 s)",
    )
