"""The recorder process of an edge: reads its task, records until a signal or its parent's end.

``python -m fleet.record.program`` is started by ``fleet run``, which writes the task to its standard input
and reads errors from its standard output: one JSON text per line, empty when there is no error.
"""

from __future__ import annotations

import asyncio
import logging
import sys

import msgspec

from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.errors import FleetError
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.process.side_program import until_ended
from fleet.record.priority import lower_priority
from fleet.record.recording import record
from fleet.record.task import RecordTask
from fleet.runtime.decoding import decode_json
from fleet.runtime.event_loop import run

log = logging.getLogger(__name__)


def _report(problem: str) -> None:
    """Write an error to our parent; if the write fails, the parent is gone, and this process ends soon."""
    sys.stdout.buffer.write(msgspec.json.encode(problem) + b"\n")
    sys.stdout.buffer.flush()


def main() -> int:
    """Read the task and record."""
    lower_priority()
    wanted = LogSettings.of_a_worker("recorder")
    start_logging(msgspec.structs.replace(wanted, level=logging.WARNING))

    async def work(ended: asyncio.Event) -> None:
        await record(task, runtime_dir(), ended, SystemClock(), on_problem=_report)

    try:
        task = decode_json(sys.stdin.buffer.read(), RecordTask)
        run(until_ended(task.parent, work))
    except msgspec.DecodeError as error:
        log.error("the task of this recorder cannot be read: %s", error)  # noqa: TRY400
        return 1
    except FleetError as error:
        _report(str(error))
        log.error("%s", error)  # noqa: TRY400 - one line for a person, no traceback
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
