"""Collects results of an edge's runs: tracks of their robots, and pictures that they report."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.clock import Clock
from fleet.errors import WireError
from fleet.missions.report import RunState
from fleet.missions.results import Results, RunFile
from fleet.missions.run import RunPort
from fleet.missions.runs import Runs
from fleet.model.report import PhotoReport
from fleet.wire.databus import decode_report


class RunResults:
    """Results of the runs of one edge. ``twins`` maps twins to the names of the robots."""

    def __init__(
        self, folder: Path, runs: Runs, robots: Mapping[str, RunPort], twins: Mapping[str, str], clock: Clock
    ) -> None:
        self._runs, self._robots, self._twins, self._clock = runs, robots, twins, clock
        self._results = Results(folder)

    def close(self) -> None:
        """Write waiting results; may block."""
        self._results.close()

    def record_positions(self) -> None:
        """Record the positions of the robots in all runs; once a second, on the event loop."""
        if not self._runs.any:
            return
        now = self._clock.time()
        for run in self._runs.all():
            for member in run.engine.robots.within():
                state = self._robots[member.robot].state()
                self._results.record_position(run.id, member.robot, state.site or state.position, now)

    def store_picture(self, twin: str, report: PhotoReport) -> None:
        """Store a picture of a robot that is in a run; from any thread."""
        robot = self._twins.get(twin, "")
        run = self._robots[robot].state().run if robot and self._runs.any else ""
        if run:
            self._results.store_picture(run, robot, report.image, report.format, self._clock.time())

    def picture_receiver(self, twin: str) -> Callable[[bytes], None]:
        """Return the receiver for the pictures of a robot in a worker; on the bus's thread."""

        def picture_receiver(sample: bytes) -> None:
            with contextlib.suppress(WireError):
                report = decode_report(PhotoReport.channel, sample)
                if isinstance(report, PhotoReport):
                    self.store_picture(twin, report)

        return picture_receiver

    def run_changed(self, state: RunState) -> None:
        """Record that a run has ended; on the event loop."""
        if state.outcome:
            self._results.end(state.run)

    def answer(self, question: Query, key: str, run: str) -> None:
        """Answer with the results of a run; without a reply for a run of another edge."""
        self._results.of(run, partial(_answer, question, key))


def _answer(question: Query, key: str, found: list[RunFile]) -> None:
    """Answer a query for results."""
    if found:
        question.reply(msgspec.json.encode(found), key)
    question.close()
