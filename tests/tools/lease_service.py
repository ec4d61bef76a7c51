"""Lease service for tests: nats-server with JetStream, on loopback."""

import contextlib
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.tools.ports import free_ports
from tests.tools.waiting import wait_until


@contextlib.contextmanager
def lease_service(folder: Path, config: str = "") -> Iterator[int]:
    """Run a server that keeps its data in a folder, inside a ``with`` block; gives its port.

    ``config`` is more of the server's configuration, such as its accounts.
    """
    (port,) = free_ports(1)
    server = shutil.which("nats-server", path=str(Path(sys.executable).parent))
    assert server is not None
    (folder / "server.conf").write_text(config)
    with (folder / "log").open("a") as log:
        command = [server, "-c", str(folder / "server.conf"), "-js", "-sd", str(folder)]
        command += ["-a", "127.0.0.1", "-p", str(port)]
        process = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            wait_until("the lease service listens", lambda: _listens(port))
            yield port
        finally:
            process.terminate()
            process.wait(20)


def _listens(port: int) -> bool:
    """Return whether somebody listens at a port."""
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
        return True
    return False
