"""Collects what the runs of an edge leave behind: the tracks of their robots, and pictures they report."""

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
from fleet.missions.results import Result, Results
from fleet.missions.run import Robot
from fleet.missions.runs import Runs
from fleet.model.report import PhotoReport
from fleet.wire.databus import decode_report


class RunResults:
    """The results of the runs of one edge. ``twins`` has the name of each robot by its twin."""

    def __init__(
        self, folder: Path, runs: Runs, robots: Mapping[str, Robot], twins: Mapping[str, str], clock: Clock
    ) -> None:
        self._runs, self._robots, self._twins, self._clock = runs, robots, twins, clock
        self._results = Results(folder)

    def close(self) -> None:
        """Write what waits; may wait."""
        self._results.close()

    def look(self) -> None:
        """Note where the robots of all runs are; once a second, on the loop."""
        if not self._runs.any:
            return
        now = self._clock.time()
        for run in self._runs.all():
            for member in run.engine.robots.within():
                state = self._robots[member.robot].state()
                self._results.at(run.id, member.robot, state.site or state.position, now)

    def pictured(self, twin: str, report: PhotoReport) -> None:
        """Keep a picture of a robot that is in a run; from any thread."""
        robot = self._twins.get(twin, "")
        run = self._robots[robot].state().run if robot and self._runs.any else ""
        if run:
            self._results.picture(run, robot, report.image, report.format, self._clock.time())

    def heard(self, twin: str) -> Callable[[bytes], None]:
        """Return what takes the pictures of a robot in a worker; on the bus's thread."""

        def heard(sample: bytes) -> None:
            with contextlib.suppress(WireError):
                report = decode_report(PhotoReport.channel, sample)
                if isinstance(report, PhotoReport):
                    self.pictured(twin, report)

        return heard

    def told(self, state: RunState) -> None:
        """Take note that a run has ended; on the loop."""
        if state.outcome:
            self._results.end(state.run)

    def answer(self, question: Query, key: str, run: str) -> None:
        """Answer with what a run has left behind; nothing for a run that is another edge's."""
        self._results.of(run, partial(_tell, question, key))


def _tell(question: Query, key: str, found: list[Result]) -> None:
    """Answer a question for results."""
    if found:
        question.reply(msgspec.json.encode(found), key)
    question.close()
