"""Exports a window of recordings in a separate process, because copying takes a processor for seconds.

``python -m fleet.record.export_program`` is started by the console, which writes the task to its standard
input. Its standard output begins with one line, the error as a JSON text; if that is empty, the file follows.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import IO, Any

import msgspec

from fleet.errors import StateError
from fleet.record.export import copy, window
from fleet.record.export_task import ExportTask
from fleet.record.priority import lower_priority
from fleet.runtime.decoding import decode_json


class _Pipe:
    """Standard output for the writer of MCAP, with a position."""

    def __init__(self, output: IO[bytes]) -> None:
        self._output = output
        self._written = 0

    def write(self, data: bytes) -> int:
        """Write bytes."""
        self._output.write(data)
        self._written += len(data)
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written


def main() -> int:
    """Read the task and export."""
    lower_priority()
    task = decode_json(sys.stdin.buffer.read(), ExportTask)
    output = sys.stdout.buffer
    try:
        messages = window([Path(each) for each in task.folders], task.since, task.until)
        first = next(messages, None)
    except (StateError, OSError) as error:
        return _write_problem(output, f"the recordings cannot be read: {error}")
    if first is None:
        return _write_problem(output, "nothing is recorded of that time")
    _write_problem(output, "")
    pipe: Any = _Pipe(output)
    copy(itertools.chain([first], messages), pipe)
    output.flush()
    return 0


def _write_problem(output: IO[bytes], problem: str) -> int:
    """Write the error, and return the exit code."""
    output.write(msgspec.json.encode(problem) + b"\n")
    output.flush()
    return 1 if problem else 0


if __name__ == "__main__":
    sys.exit(main())
