"""Ports of this computer that nobody has."""

import contextlib
import errno
import random
import socket

RANGE = range(20_000, 32_000)
"""Ports below the kernel's own range (32768 to 60999): no outgoing connection gets one in the meantime."""


def free_ports(number: int, kind: socket.SocketKind = socket.SOCK_STREAM) -> list[int]:
    """Return ports on loopback that no program has now; all differ."""
    choice = random.SystemRandom()  # independent of the seed, which may be the same in parallel processes
    found: set[int] = set()
    while len(found) < number:
        port = choice.choice(RANGE)
        if _is_free(port, kind):
            found.add(port)
    return list(found)


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    """Return True if a program could listen on the port."""
    with contextlib.closing(socket.socket(socket.AF_INET, kind)) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            return False
    return True
