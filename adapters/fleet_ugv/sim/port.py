"""A simulated board on a pseudo-terminal whose cable can be pulled."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import tty
from pathlib import Path

from fleet_ugv.sim.board import SimBoard

STEP = 0.01  # s between two steps of a board
_PIECE = 4096


class SimPort:
    """One board behind a device file, ``path``, a symbolic link that outlives its cable."""

    def __init__(self, board: SimBoard, path: Path, baud: int) -> None:
        self.board = board
        self.path = path
        self.url = f"serial:{path}?baud={baud}"
        self._loop = asyncio.get_running_loop()
        self._started = self._loop.time()
        self._master = self._device = -1
        self._back_at = 0.0
        self.plug()

    def now(self) -> float:
        """Return seconds since the start."""
        return self._loop.time() - self._started

    @property
    def plugged(self) -> bool:
        """True while there is a device."""
        return self._master >= 0

    def plug(self) -> None:
        """Plug the cable in."""
        self._master, self._device = pty.openpty()
        tty.setraw(self._device)  # kept open: otherwise a client that closes it would end the terminal
        os.set_blocking(self._master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._device))
        self._loop.add_reader(self._master, self._readable)

    def unplug(self, seconds: float = float("inf")) -> None:
        """Pull the cable, for a time in seconds."""
        if not self.plugged:
            return
        self._back_at = self.now() + seconds
        self._loop.remove_reader(self._master)
        self.path.unlink(missing_ok=True)
        for descriptor in (self._master, self._device):
            os.close(descriptor)
        self._master = self._device = -1

    def fault(self, name: str, value: float | None) -> None:
        """Start a fault, or end it (None); raises ValueError."""
        if name == "unplug" and value is not None:
            self.unplug(value)
        else:
            self.board.set_fault(name, value)

    def true_state(self) -> dict[str, float]:
        """Return the true pose of the base (m, rad) and the speeds of its sides (m/s)."""
        physics = self.board.physics
        left, right = physics.speeds
        return {"x": physics.x, "y": physics.y, "yaw": physics.yaw, "left": left, "right": right}

    def step(self) -> None:
        """Simulate the board up to now."""
        if not self.plugged and self.now() >= self._back_at:
            self.plug()
        self._write(self.board.step(self.now()))

    def _readable(self) -> None:
        """Give written bytes to the board."""
        with contextlib.suppress(BlockingIOError):
            self._write(self.board.receive(os.read(self._master, _PIECE), self.now()))

    def _write(self, data: bytes) -> None:
        """Write to the terminal; unread bytes are lost, as on a real line."""
        if data and self.plugged:
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, data)

    def close(self) -> None:
        """Close the terminal."""
        self.unplug()
