"""Console pad for tests: from the button in a real browser to the datagrams on a robot's wire."""

import contextlib
import socket
import threading
import time
from pathlib import Path

from playwright.sync_api import Error

from tests.tools.waiting import wait_until

WIRED = Path(__file__).parent / "wired_plugins"
"""The folder to name under ``plugins`` in fleet.yaml, for robots with ``adapter: wired``."""
LEASE = 0.5  # s, the default of fleet.yaml
MOVES, STANDS = b"drive 0.5", (b"drive 0", b"halt")
RELEASED = """addEventListener('pointerup', () => {
    window.released = (performance.timeOrigin + performance.now()) / 1000;
}, true)"""


class RobotWire:
    """The robot's end of a wire: keeps what arrives, with Unix seconds, and shows that the robot lives."""

    def __init__(self, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.settimeout(0.1)
        self.link = f"udpin:127.0.0.1:{port}"
        self.frames = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _read(self):
        written_at = 0.0
        while not self._ended.is_set():
            with contextlib.suppress(TimeoutError, ConnectionError):
                if time.monotonic() - written_at > 0.2:
                    written_at = time.monotonic()
                    self._socket.send(b"here\n")
                frame = self._socket.recv(100)
                self.frames.append((time.time(), frame))

    def standing_since(self, moment):
        """Return when the robot was first told to stand after a moment, None while it was not."""
        return next((at for at, frame in list(self.frames) if at >= moment and frame in STANDS), None)


def drive(page, wire):
    """Hold the pad's button until the robot drives."""
    page.hover(".axis.forward")
    before = len(wire.frames)
    page.mouse.down()

    def drives():
        page.evaluate("1")
        return MOVES in [frame for _, frame in wire.frames[before:]]

    wait_until("it drives", drives)


def release(page, wire):
    """Let go of the button; return the seconds from the page's event to the zero on the wire."""
    page.mouse.up()
    at = page.evaluate("window.released")
    return wait_until("the zero", lambda: wire.standing_since(at)) - at


def kill_tab(page, wire):
    """Kill the page's process while it drives; return the seconds to the zero on the wire."""
    at = time.time()
    with contextlib.suppress(Error):  # a page that is gone answers nothing
        page.goto("chrome://crash", timeout=2000)
    return wait_until("the zero", lambda: wire.standing_since(at)) - at
