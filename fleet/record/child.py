"""The recorder as a child process of ``fleet run``: start, monitor, restart."""

from __future__ import annotations

import asyncio
import importlib.util
import logging
import os

import msgspec

from fleet.clock import Clock
from fleet.host.process.side_program import SideProgram
from fleet.record.task import RecordTask
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

EXTRA = "recording needs its extra: pip install 'zenoh-fleet[record]' (here: uv sync --extra record)"


def is_installed() -> bool:
    """Return True if the packages of the extra are installed."""
    return all(importlib.util.find_spec(name) for name in ("mcap", "zstandard"))


class RecorderChild:
    """One recorder process. ``recording`` is set once it records."""

    def __init__(self, task: RecordTask, clock: Clock) -> None:
        encoded_task = msgspec.json.encode(msgspec.structs.replace(task, parent=os.getpid()))
        self._program = SideProgram(
            "recorder", "fleet.record.program", encoded_task, clock, self._hear, heard=True
        )
        self._reported = ""
        self.recording = asyncio.Event()

    @property
    def problem(self) -> str:
        """Its error, in its own words if it reported one; empty while it records."""
        return self._program.problem and (self._reported or self._program.problem)

    @property
    def process(self) -> int:
        """The id of its process, 0 before the first start."""
        return self._program.process

    async def run(self) -> None:
        """Keep the recorder running until cancelled."""
        if not is_installed():
            self._program.problem = EXTRA
            log.warning("%s", EXTRA)
            return
        await self._program.run()

    async def _hear(self, process: asyncio.subprocess.Process) -> None:
        """Receive the errors that the process reports."""
        assert process.stdout is not None
        self._reported = ""
        async for line in process.stdout:
            try:
                self._reported = self._program.problem = decode_json(line, str)
            except msgspec.DecodeError:
                log.warning("the recorder's report cannot be read")
            if not self._reported:
                self.recording.set()
