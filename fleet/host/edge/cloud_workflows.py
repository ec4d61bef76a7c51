"""Workflows of the cloud that start missions: only those that fleet.yaml maps.

An execution of a workflow is a mission run whose id is the execution's uuid, so a repeated request is the
same run. It has the source type that fleet.yaml gives the workflow; every robot must accept that for missions
and for each step. Each robot also judges the age of the request, as for a command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from uuid import UUID

from fleet.clock import Clock
from fleet.cloud.values import CloudMessage
from fleet.config.missions import Mission
from fleet.config.schema import WorkflowConfig
from fleet.errors import Refused
from fleet.host.edge.start_requests import StartRequests
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState, ended_state
from fleet.missions.runs import Runs, check_run_id
from fleet.missions.state import RunHead, RunMember, RunOutcome
from fleet.missions.store import RunOrigin
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.wire.rules import WORKFLOW_CANCEL, WORKFLOW_FINISHED, WORKFLOW_RUN, WORKFLOW_STARTED
from fleet.wire.topics import Topic
from fleet.wire.workflows import WorkflowOutcome, WorkflowRequest, decode_workflow, finished, started

ENDS: Mapping[str, WorkflowOutcome] = {
    RunOutcome.COMPLETED: "success",
    RunOutcome.WITH_LOSSES: "success",
    RunOutcome.FAILED: "error",
    RunOutcome.UNDONE: "error",
    RunOutcome.UNDO_FAILED: "error",
    RunOutcome.ABORTED: "canceled",
    RunOutcome.UNKNOWN: "error",
}
"""End of a run as the end of a workflow execution; the message has the exact outcome."""


class CloudWorkflows:
    """Workflows of one edge, by uuid. ``publish`` sends a status: uuid, suffix, payload; any thread."""

    def __init__(
        self,
        workflows: Mapping[UUID, WorkflowConfig],
        mission: Callable[[str], Mission | None],
        runs: Runs,
        starts: StartRequests,
        *,
        record: Callable[[str, EventReport], None],
        clock: Clock,
    ) -> None:
        self._workflows = {str(uuid): config for uuid, config in workflows.items()}
        self._mission, self._runs, self._starts = mission, runs, starts
        self._record, self._clock = record, clock
        self.publish: Callable[[str, str, bytes], None] = lambda _uuid, _suffix, _payload: None

    @property
    def handlers(self) -> Mapping[str, Callable[[Topic, CloudMessage], None]]:
        """Handlers of the cloud's messages, by suffix; on the event loop. They raise WireError."""
        return {WORKFLOW_RUN: self._run, WORKFLOW_CANCEL: self._cancel}

    def run_changed(self, state: RunState) -> None:
        """Publish the end of a workflow's run; on the event loop."""
        run = self._runs.find(state.run) if state.outcome else None
        if run is not None and run.about.workflow:
            self._finish(run.about.workflow, state)

    def _run(self, topic: Topic, message: CloudMessage) -> None:
        """Start a run, unless it is known already."""
        workflow, requested = topic.twin, decode_workflow(message.payload)
        config = self._workflows[workflow]

        def made() -> tuple[Mission, MissionStartRequest]:
            check_run_id(requested.execution)
            mission = self._mission(config.mission)
            if mission is None:
                raise Refused(f"there is no mission {config.mission!r}")
            request = MissionStartRequest(
                inputs={**requested.inputs, **config.inputs},
                run=requested.execution,
                session_id=_name(workflow, requested),
                source_type=config.source_type,
                timestamp=requested.stamp,
            )
            return mission, request

        self._starts.begin(
            made, Transport.CLOUD, partial(self._began, workflow, requested), workflow=workflow
        )

    def _began(
        self,
        workflow: str,
        requested: WorkflowRequest,
        _run: str,
        _roles: Mapping[str, Sequence[str]],
        refusal: str,
    ) -> None:
        """Publish that a run was started, now or earlier; or why not. From any thread."""
        if not refusal:
            self.publish(workflow, WORKFLOW_STARTED, started(requested.execution))
            return
        self._runs.store.ended_run(requested.execution, partial(self._refused, workflow, requested, refusal))

    def _refused(
        self,
        workflow: str,
        requested: WorkflowRequest,
        refusal: str,
        ended: tuple[RunOrigin, RunHead, list[RunMember]] | None,
    ) -> None:
        """Publish why a run was not started; for an ended run, its end again. From any thread."""
        if ended is not None and ended[0].workflow == workflow:
            self._finish(workflow, ended_state(*ended, self._runs.edge))
            return
        who = Requester(Transport.CLOUD, _name(workflow, requested), self._workflows[workflow].source_type)
        mission, now = self._workflows[workflow].mission, self._clock.time()
        text = f"mission {mission} refused: {refusal}"
        event = EventReport(now, EventKind.COMMAND, text, Severity.WARNING, who, mission, requested.execution)
        self._record("", event)
        self._publish_end(workflow, requested.execution, "error", f"refused: {refusal}")

    def _cancel(self, topic: Topic, message: CloudMessage) -> None:
        """Abort a run of this workflow; runs that have ended, or are not of it, are left alone."""
        requested = decode_workflow(message.payload)
        run = self._runs.find(requested.execution)
        if run is not None and run.about.workflow == topic.twin:
            self._runs.control(run.id, RunControlRequest("abort", session_id=_name(topic.twin, requested)))

    def _finish(self, workflow: str, state: RunState) -> None:
        """Publish the end of a run, with its exact outcome unless it was completed."""
        words = f"{state.outcome}: {state.reason}" if state.reason else state.outcome
        completed = state.outcome == RunOutcome.COMPLETED
        self._publish_end(workflow, state.run, ENDS[state.outcome], "" if completed else words)

    def _publish_end(self, workflow: str, execution: str, end: WorkflowOutcome, message: str) -> None:
        """Publish the end of an execution, unless its id is invalid in a topic."""
        try:
            check_run_id(execution)
        except Refused:
            return
        self.publish(workflow, WORKFLOW_FINISHED.replace("+", execution), finished(end, message))


def _name(workflow: str, requested: WorkflowRequest) -> str:
    """Return the sender of a run, for people and as the session of the request."""
    return f"workflow {workflow}" + (f" by {requested.by[:40]}" if requested.by else "")
