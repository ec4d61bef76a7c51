"""Log lines to the journal of systemd with their fields, by journald's own protocol.

One datagram per line to ``/run/systemd/journal/socket`` (systemd: Native Journal Protocol). Level, robot and
logger are fields, so that  ``journalctl -u fleet-yard-1 FLEET_ROBOT=rex -p warning``  finds them.
"""

from __future__ import annotations

import contextlib
import logging
import os
import socket
from collections.abc import Mapping
from pathlib import Path

from fleet.host.logs.flood_filter import FloodFilter
from fleet.host.logs.line_format import LogLine, line_of

SOCKET = Path("/run/systemd/journal/socket")
STREAM = "JOURNAL_STREAM"
"""Environment variable of systemd: device and inode of the stream that goes to the journal."""
LONGEST = 60_000  # bytes per datagram: the default limit of a Unix socket, with room for the fields
_PRIORITIES = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6))


def is_journal(descriptor: int, environ: Mapping[str, str] = os.environ) -> bool:
    """Return True when a stream goes to the journal of systemd, and not to a terminal or file."""
    try:
        found = os.fstat(descriptor)
    except OSError:
        return False
    return environ.get(STREAM) == f"{found.st_dev}:{found.st_ino}" and SOCKET.exists()


def fields_of(line: LogLine, level: int, identifier: str) -> dict[str, str]:
    """Return the fields of a line; names that are not journald's own begin with FLEET."""
    priority = next((number for least, number in _PRIORITIES if level >= least), 7)
    fields = {
        "MESSAGE": f"{line.message}\n{line.error}" if line.error else line.message,
        "PRIORITY": str(priority),
        "SYSLOG_IDENTIFIER": identifier,
        "FLEET_LOGGER": line.logger,
        "FLEET_ROBOT": line.robot,
    }
    return {name: text for name, text in fields.items() if text}


def datagram(fields: Mapping[str, str]) -> bytes:
    """Return the fields as one datagram; each has its length, so that no text can forge a field."""
    parts = []
    for name, text in fields.items():
        value = text.encode(errors="backslashreplace")[:LONGEST]
        parts.append(b"%s\n%s%s\n" % (name.encode(), len(value).to_bytes(8, "little"), value))
    return b"".join(parts)


class JournalHandler(logging.Handler):
    """Sends records to the journal without waiting; a record that journald does not accept is dropped."""

    def __init__(self, level: int, identifier: str, path: Path = SOCKET) -> None:
        super().__init__(level)
        self._identifier = identifier
        self._path = str(path)
        self._flood = FloodFilter()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def emit(self, record: logging.LogRecord) -> None:
        """Send one line, unless there were too many like it."""
        more = self._flood.admit((record.name, str(record.msg)), record.created)
        if more is None:
            return
        line = line_of(record, self.formatter or logging.Formatter())
        fields = fields_of(line, record.levelno, self._identifier)
        if more:
            fields["FLEET_LEFT_OUT"] = str(more)
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram(fields), self._path)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        super().close()
