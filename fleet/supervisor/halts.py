"""Registered halts of robots: a copy of the link, held open by the supervisor, and the frames to write."""

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
from fleet.link.gate import boot_time
from fleet.supervisor.protocol import (
    HaltRegistered,
    HaltUnregistered,
    RegisterHalt,
    UnregisterHalt,
    WriteUntil,
)

HALT_MARGIN = 0.4  # s before the right to write ends in which halts are written

Write = Callable[[bytes], object]


class RegisteredHalt(msgspec.Struct, frozen=True):
    """Halt of one robot: its frames and how to write them; ``close`` closes the copy of its link."""

    frames: tuple[bytes, ...]
    write: Write
    close: Callable[[], None]


def registered_halt(descriptor: int, frames: tuple[bytes, ...], address: Address) -> RegisteredHalt:
    """Return the halt for a link of which this process has a descriptor of its own.

    Raises OSError for a descriptor that is neither a socket nor a device.
    """
    if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
        sock = socket.socket(fileno=descriptor)
        sock.setblocking(False)
        return RegisteredHalt(frames, _to(sock, address), sock.close)
    os.set_blocking(descriptor, False)
    return RegisteredHalt(frames, _to_device(descriptor), lambda: os.close(descriptor))


def _to(sock: socket.socket, address: Address) -> Write:
    """Return a function that writes to a socket."""
    return sock.send if address is None else lambda frame: sock.sendto(frame, address)


def _to_device(descriptor: int) -> Write:
    """Return a function that writes to a serial device; a full output queue is discarded for the halt."""

    def write(frame: bytes) -> None:
        try:
            os.write(descriptor, frame)
        except BlockingIOError:
            termios.tcflush(descriptor, termios.TCOFLUSH)
            os.write(descriptor, frame)

    return write


class ProcessHalts:
    """Registered halts of one process, by robot; a newer halt of a robot replaces the older one."""

    def __init__(self) -> None:
        self.until: float | None = None  # when the right to write ends (s since the computer's start)
        self._kept: dict[str, RegisteredHalt] = {}

    @property
    def robots(self) -> list[str]:
        """Names of the robots that can be halted."""
        return sorted(self._kept)

    def apply(
        self, message: RegisterHalt | UnregisterHalt | WriteUntil, descriptors: list[int]
    ) -> HaltRegistered | HaltUnregistered | None:
        """Apply a message of the process and return the answer. Raises OSError like ``register``."""
        match message:
            case RegisterHalt():
                self.register(message.robot, message.frames, message.address, descriptors)
                return HaltRegistered(message.number)
            case UnregisterHalt():
                self.drop(message.robot)
                return HaltUnregistered(message.number)
            case WriteUntil():
                self.until = message.until
                return None

    def store(self, robot: str, halt: RegisteredHalt) -> None:
        """Keep a robot's halt in place of an earlier one."""
        self.drop(robot)
        self._kept[robot] = halt

    def register(
        self, robot: str, frames: tuple[bytes, ...], address: Address, descriptors: list[int]
    ) -> None:
        """Keep a robot's halt for the link that came with it, the last of ``descriptors``; raises OSError."""
        if not descriptors:
            raise OSError(errno.EBADF, f"the link of {robot} did not come with its halt")
        halt = registered_halt(descriptors[-1], frames, address)
        descriptors.pop()  # only now: the caller closes the descriptors that are left in the list
        self.store(robot, halt)

    def drop(self, robot: str) -> None:
        """Remove a robot's halt, if it has one, and close its link."""
        halt = self._kept.pop(robot, None)
        if halt is not None:
            with contextlib.suppress(OSError):
                halt.close()

    def write(self) -> list[str]:
        """Halt every robot; return those whose link accepted it. A failure does not affect the others.

        Once another edge may have the robots, nothing is written.
        """
        if self.until is not None and boot_time() >= self.until:
            return []
        return [robot for robot, halt in self._kept.items() if _written(halt)]

    @property
    def must_halt(self) -> bool:
        """True just before the right to write ends while robots are still registered: their process hangs."""
        return self.until is not None and bool(self._kept) and 0 < self.until - boot_time() < HALT_MARGIN

    def close(self) -> None:
        """Remove all halts."""
        for robot in self.robots:
            self.drop(robot)


def _written(halt: RegisteredHalt) -> bool:
    """Write a halt; return False when the link does not accept it."""
    try:
        for frame in halt.frames:
            halt.write(frame)
    except Exception:  # noqa: BLE001 - no failure may keep the other robots from their halts
        return False
    return True
