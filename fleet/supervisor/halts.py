"""The halts of robots whose process may die: their links, held open by another process, and what to write."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import stat
import termios
from collections.abc import Callable

import msgspec

from fleet.link.base import Address

Write = Callable[[bytes], object]


class RegisteredHalt(msgspec.Struct, frozen=True):
    """How one robot is halted; ``close`` lets go of its link."""

    frames: tuple[bytes, ...]
    write: Write
    close: Callable[[], None]


def registered_halt(descriptor: int, frames: tuple[bytes, ...], address: Address) -> RegisteredHalt:
    """Return how frames are written to a link of which this process has a descriptor of its own.

    Raises OSError for a descriptor that is neither a socket nor a device.
    """
    if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
        sock = socket.socket(fileno=descriptor)
        sock.setblocking(False)
        return RegisteredHalt(frames, _to(sock, address), sock.close)
    os.set_blocking(descriptor, False)
    return RegisteredHalt(frames, _to_device(descriptor), lambda: os.close(descriptor))


def _to(sock: socket.socket, address: Address) -> Write:
    """Return what writes to a socket."""
    return sock.send if address is None else lambda frame: sock.sendto(frame, address)


def _to_device(descriptor: int) -> Write:
    """Return what writes to a serial device; what the line has not taken yet makes room for a halt."""

    def write(frame: bytes) -> None:
        try:
            os.write(descriptor, frame)
        except BlockingIOError:
            termios.tcflush(descriptor, termios.TCOFLUSH)
            os.write(descriptor, frame)

    return write


class ProcessHalts:
    """Those of one process, by robot. The last that a robot left counts."""

    def __init__(self) -> None:
        self._kept: dict[str, RegisteredHalt] = {}

    @property
    def robots(self) -> list[str]:
        """The robots that can be halted."""
        return sorted(self._kept)

    def keep(self, robot: str, halt: RegisteredHalt) -> None:
        """Keep a robot's halt in place of an earlier one."""
        self.drop(robot)
        self._kept[robot] = halt

    def take(self, robot: str, frames: tuple[bytes, ...], address: Address, descriptors: list[int]) -> None:
        """Keep a robot's halt for the link that came with it, the last of ``descriptors``; raises OSError."""
        if not descriptors:
            raise OSError(errno.EBADF, f"the link of {robot} did not come with its halt")
        halt = registered_halt(descriptors[-1], frames, address)
        descriptors.pop()
        self.keep(robot, halt)

    def drop(self, robot: str) -> None:
        """Forget a robot's halt; one that is not known is none."""
        halt = self._kept.pop(robot, None)
        if halt is not None:
            with contextlib.suppress(OSError):
                halt.close()

    def write(self) -> list[str]:
        """Halt every robot; return those whose link took it. One that fails keeps no other from its halt."""
        return [robot for robot, halt in self._kept.items() if _written(halt)]

    def close(self) -> None:
        """Forget all."""
        for robot in self.robots:
            self.drop(robot)


def _written(halt: RegisteredHalt) -> bool:
    """Write a halt; return False for a link that does not take it."""
    try:
        for frame in halt.frames:
            halt.write(frame)
    except Exception:  # noqa: BLE001 - whatever is wrong with one keeps no other from its halt
        return False
    return True
