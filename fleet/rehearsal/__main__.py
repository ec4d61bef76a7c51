"""``python -m fleet.rehearsal``: one rehearsal, as the edge starts it.

Reads a ``RehearsalTask`` as one line of JSON, and writes ``RehearsalLine`` lines; the last one has the result
or the failure. Ends when its standard input is closed, since no reader is left then. It joins no bus and
writes nothing to disk.
"""

from __future__ import annotations

import logging
import os
import sys
import threading

import msgspec

from fleet.host.edge.rehearsal_task import RehearsalLine, RehearsalTask
from fleet.rehearsal.rehearsal import rehearse
from fleet.runtime.decoding import decode_json

NICE = 10  # robots have priority
_encode = msgspec.json.Encoder().encode


def write_line(line: RehearsalLine) -> None:
    """Write a line."""
    sys.stdout.buffer.write(_encode(line) + b"\n")
    sys.stdout.buffer.flush()


def _end_with_stdin() -> None:
    """Exit at once when standard input is closed."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(1)


def main() -> int:
    """Execute the rehearsal given on standard input."""
    os.nice(NICE)
    logging.basicConfig(level=logging.ERROR, stream=sys.stderr)
    try:
        task = decode_json(sys.stdin.buffer.readline(), RehearsalTask)
    except msgspec.DecodeError as error:
        write_line(RehearsalLine(failure=f"the task cannot be read: {error}"))
        return 1
    threading.Thread(target=_end_with_stdin, daemon=True).start()
    os.environ["XDG_STATE_HOME"] = os.environ["XDG_CACHE_HOME"] = os.devnull  # no folder can be created there
    write_line(rehearse(task, write_line))
    return 0


if __name__ == "__main__":
    sys.exit(main())
