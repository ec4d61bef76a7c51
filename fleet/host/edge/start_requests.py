"""Starts missions on request: checked on a separate thread, filled and started on the event loop."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import msgspec

from fleet.config.missions import Mission
from fleet.config.problems import InvalidConfig
from fleet.errors import Refused
from fleet.missions.program import Program
from fleet.missions.report import MissionStartRequest
from fleet.missions.runs import Began, Runs
from fleet.model.command import Transport

log = logging.getLogger(__name__)

Made = Callable[[], tuple[Mission, MissionStartRequest]]
"""Returns the mission of a request, and the request; raises Refused, InvalidConfig, DecodeError."""
Checked = Callable[[Mission, Program, MissionStartRequest], None]
"""Continues with a checked mission."""


class StartRequests:
    """Starts the runs of an edge. ``described`` calls back once robots are described."""

    def __init__(
        self,
        runs: Runs,
        described: Callable[[Callable[[], None]], None],
        soon: Callable[[Callable[[], None]], None],
    ) -> None:
        self._runs, self._described, self._soon = runs, described, soon
        self._checker = ThreadPoolExecutor(1, thread_name_prefix="fleet-mission-check")

    def begin(
        self, made: Made, transport: Transport, began: Began, *, workflow: str = "", admitted: bool = False
    ) -> None:
        """Check a mission and start it, or answer which robots would fill its roles; from any thread.

        ``began`` gets the result, on any thread. The other arguments are those of ``Runs.start``.
        """

        def start(mission: Mission, program: Program, request: MissionStartRequest) -> None:
            if not request.only_fill:
                self._runs.start(
                    mission, program, request, transport, began, workflow=workflow, admitted=admitted
                )
                return
            try:
                began("", self._runs.filling.fill(mission, program, request), "")
            except Refused as error:
                began("", {}, str(error))

        self.check(made, start, began)

    def check(self, made: Made, then: Checked, began: Began) -> None:
        """Check a mission and continue with it on the loop; ``began`` gets a refusal. From any thread."""
        try:
            self._checker.submit(self._check, made, then, began)
        except RuntimeError:  # closed
            began("", {}, "the edge ends")

    def close(self) -> None:
        """Stop starting missions; waits for a check in progress."""
        self._checker.shutdown(cancel_futures=True)

    def _check(self, made: Made, then: Checked, began: Began) -> None:
        """Check a mission; this may take long, so not on the event loop."""
        try:
            mission, request = made()
            program = mission.program(request.inputs)
            if request.run and not request.only_fill and self._runs.store.has_ended(request.run):
                raise Refused(f"run {request.run} has ended: a repeat of it is not carried out")  # noqa: TRY301
        except (Refused, InvalidConfig, msgspec.DecodeError) as error:
            began("", {}, str(error))
        except Exception as error:
            log.exception("a mission could not be checked")
            began("", {}, f"{type(error).__name__}; the edge's log says why")
        else:
            self._soon(partial(self._described, partial(then, mission, program, request)))
