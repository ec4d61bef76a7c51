"""The first screen of ``fleet demo`` is the one that README shows, and two demos run side by side."""

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
from pathlib import Path

from tests.tools.waiting import wait_until

README = Path(__file__).parents[2] / "README.md"
WITHIN = 60.0  # s
REDRAWN = re.compile(r"\x1b\[(2K|1A)")  # a line is cleared, or the line above it is gone back to
BUSY = "blocks the event loop|offline: |does not end|overloaded"  # other tests have the processor
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """A program on a terminal of its own, 200 columns wide; ``text`` is what it has shown so far."""

    def __init__(self, *command, runtime):
        self.text = ""
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 200, 0, 0))
        environment = os.environ | {"FLEET_RUNTIME_DIR": runtime, "TERM": "xterm", "COLUMNS": "200"}
        self.process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=environment)
        os.close(slave)

    def shows(self, wanted):
        """Wait until the program has shown these lines, and return all that it has shown."""

        def shown():
            self._read()
            return set(wanted) <= set(lines(self.text))

        try:
            wait_until(f"{wanted} on the screen", shown, within=4 * WITHIN)
        except AssertionError as error:
            raise AssertionError(f"{error}; it shows:\n{self.text}") from None
        return self.text

    def end(self):
        """Press Ctrl-C and wait for the end."""
        self.process.send_signal(signal.SIGINT)
        with contextlib.suppress(OSError):  # the terminal ends with the program
            while self.process.poll() is None:
                self._read()
        self.process.wait(WITHIN)
        os.close(self._master)

    def _read(self):
        while select.select([self._master], [], [], 0.1)[0]:
            text = os.read(self._master, 65536).decode().replace("\r", "")
            self.text += ESCAPE.sub("", REDRAWN.sub("\n", text))


def test_the_first_screen_is_the_one_that_readme_shows(runtime):
    wanted = lines(re.search(r"```text\n(MQTT broker.*?)```", README.read_text(), re.DOTALL)[1])
    terminal = Terminal(sys.executable, "-m", "fleet", "demo", runtime=runtime)
    try:
        shown = terminal.shows(wanted)
    finally:
        terminal.end()
    warned = [line for line in shown.splitlines() if re.search("WARNING|ERROR", line)]
    assert [line for line in warned if not re.search(BUSY, line)] == [], shown


def test_a_second_demo_says_how_to_start_it_and_runs_beside_the_first(fleet, subscriber):
    one_drone = ("demo", "--drones", "1", "--ugvs", "0", "--dogs", "0", "--json")
    first = fleet(*one_drone)
    port = int(first.line(r"MQTT broker +127.0.0.1:(\d+)")[1])
    first.robot("drone-1", "is well", lambda state: state["health"] == "ok")
    refused = first.call("demo")
    assert refused.returncode == 1
    assert "edge 'demo' runs already on this machine" in refused.stderr
    assert "start another demo beside it with --edge-id demo-2" in refused.stderr

    second = fleet(*one_drone, "--edge-id", "demo-2")
    other_port = int(second.line(r"MQTT broker +127.0.0.1:(\d+)")[1])
    assert other_port != port
    well = second.robot("drone-1", "is well", lambda state: state["health"] == "ok")
    assert well["twin"] != first.states["drone-1"]["twin"]
    takeoff = ("send", "demo-2/drone-1", "takeoff", "altitude=2", "--wait")
    # Until its autopilot knows where the drone is, a take-off is refused.
    wait_until("it takes off", lambda: second.call(*takeoff).returncode == 0)
    second.robot("drone-1", "flies", lambda state: state["armed"])
    assert not first.states["drone-1"]["armed"]
    assert "start another demo beside it with --edge-id demo-3" in second.call("demo").stderr


def lines(text):
    """Return the lines in a form that is the same each time: without time, port, load and widths."""
    text = re.sub(r"degraded \(this computer is overloaded: [^)]*\)", "ok", text)
    text = re.sub(r"connected \(\d+ dropped\)", "connected", text)
    text = re.sub(r"127\.0\.0\.1:\d+", "127.0.0.1:1883", re.sub(r"\b\d+ s\b", "4 s", text))
    found = [" ".join(line.split()) for line in text.splitlines()]
    return [line for line in found if not line.startswith("try, in another terminal:")]
