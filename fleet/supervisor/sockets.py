"""Sockets of supervisors in the runtime folder, accessible to this user only."""

from __future__ import annotations

import contextlib
import functools
import grp
import os
import pwd
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "FLEET_SUPERVISOR"
"""Environment variable with the socket path of the supervisor, for processes with robots."""
LONGEST = 107  # bytes of a socket's path that the kernel accepts
_PREFIX, _SUFFIX = "supervisor-", ".sock"
_PEER = struct.Struct("3i")  # struct ucred of SO_PEERCRED: process, user, group


def socket_of(directory: Path, process: int) -> Path:
    """Return the socket path of the supervisor with this process id."""
    return directory / f"{_PREFIX}{process}{_SUFFIX}"


def sockets_in(directory: Path) -> Iterator[Path]:
    """Yield the sockets of all supervisors, including dead ones."""
    yield from sorted(directory.glob(f"{_PREFIX}*{_SUFFIX}"))


def listening(path: Path) -> socket.socket:
    """Return a socket that listens at a path, replacing that of a dead process; raises OSError.

    It gets its name once it listens: a stop removes a socket that refuses it as that of a dead process.
    """
    unnamed = path.with_name(f".{path.name}")
    if len(str(unnamed).encode()) > LONGEST:
        raise OSError(f"{path} is too long for a Unix socket; set FLEET_RUNTIME_DIR to a shorter place")
    unnamed.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        listener.bind(str(unnamed))
        listener.listen()
        listener.setblocking(False)
        unnamed.replace(path)
    except OSError:
        listener.close()
        raise
    return listener


def connected(path: Path, *, within: float) -> socket.socket:
    """Return a connection to the supervisor at a path; raises OSError."""
    sock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        sock.settimeout(within)
        sock.connect(str(path))
    except OSError:
        sock.close()
        raise
    return sock


def user_of(sock: socket.socket) -> str:
    """Return the user of the process at the other end, as known to the kernel; never raises."""
    try:
        found = sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
    except OSError:
        return "unknown user"
    _, user, _ = _PEER.unpack(found)
    return users().get(user, f"user {user}")


@functools.cache
def users() -> dict[int, str]:
    """Return the names of the users that can open the sockets, by id; the first call may block.

    They are root, this user, and for a service the members of its group.
    """
    names = {0: "root"}
    with contextlib.suppress(KeyError):
        for member in grp.getgrgid(os.getegid()).gr_mem:
            names[pwd.getpwnam(member).pw_uid] = member
    try:
        names[os.getuid()] = pwd.getpwuid(os.getuid()).pw_name
    except KeyError:  # a user without a name, as containers have
        names[os.getuid()] = f"user {os.getuid()}"
    return names
