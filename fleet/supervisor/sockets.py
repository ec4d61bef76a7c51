"""Where supervisors listen: sockets in the runtime folder, for this user alone."""

from __future__ import annotations

import functools
import os
import pwd
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "FLEET_SUPERVISOR"
"""The environment variable that tells processes with robots where their supervisor listens."""
LONGEST = 107  # bytes of a socket's path that the kernel takes
_PREFIX, _SUFFIX = "supervisor-", ".sock"
_PEER = struct.Struct("3i")  # what the kernel tells of a peer: process, user, group


def socket_of(directory: Path, process: int) -> Path:
    """Return where the supervisor of this process id listens."""
    return directory / f"{_PREFIX}{process}{_SUFFIX}"


def sockets_in(directory: Path) -> Iterator[Path]:
    """Yield the sockets of all supervisors, those of dead ones included."""
    yield from sorted(directory.glob(f"{_PREFIX}*{_SUFFIX}"))


def listening(path: Path) -> socket.socket:
    """Return a socket that listens at a path, in place of a dead process's; raises OSError."""
    if len(str(path).encode()) > LONGEST:
        raise OSError(f"{path} is too long for a Unix socket; set FLEET_RUNTIME_DIR to a shorter place")
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        listener.bind(str(path))
        listener.listen()
        listener.setblocking(False)
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
    """Return the user whose process is at the other end, as the kernel knows it; never raises."""
    try:
        found = sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
    except OSError:
        return "unknown user"
    _, user, _ = _PEER.unpack(found)
    return users().get(user, f"user {user}")


@functools.cache
def users() -> dict[int, str]:
    """Return the names of who can reach the sockets, root and this user; may wait the first time."""
    names = {0: "root"}
    try:
        names[os.getuid()] = pwd.getpwuid(os.getuid()).pw_name
    except KeyError:  # a user without a name, as containers have
        names[os.getuid()] = f"user {os.getuid()}"
    return names
