"""``mission/command`` of the cloud: a twin's plan, executed as a mission run.

The run's id is the ``mission_execution_uuid``, so a repeat is the same run. It commands the robot in the name
of the message's sender, who must have the right to navigate the robot, as for a goal. ``mission/status``
reports every run in which a robot flies a plan, of any sender: queued, running with the robot's present item,
and its end, with the exact outcome in ``message``.

==============  ==========================================================================================
command         effect ==============
========================================================================================== start
starts the run; refused if the robot would refuse the plan, and while a run has the robot pause, resume
pauses and continues the run; resume also answers a run that asks whether to go on cancel, stop    aborts the
run, and stops the robot at once, without waiting for the run ==============
==========================================================================================

Without a run of this id (of any, if the message names none), all but ``start`` goes to the robot itself.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import msgspec

from fleet.bridge.command_replies import RobotPort
from fleet.clock import Clock
from fleet.config.missions import Mission, mission_of
from fleet.errors import WireError
from fleet.host.edge.start_requests import StartRequests
from fleet.host.safety.admission import JOIN
from fleet.host.safety.source_policy import SourcePolicy
from fleet.missions.plan import PILOT, mission_of_plan
from fleet.missions.program import Do, Program
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState, ended_state
from fleet.missions.run import Run
from fleet.missions.runs import Runs, check_run_id
from fleet.missions.state import Phase, RunHead, RunMember, RunOutcome
from fleet.missions.store import RunOrigin
from fleet.model.command import Answer, Origin, Reply, ReplyStatus, Request, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.navigation import MISSION, ActionState, Control, Navigate
from fleet.model.report import NavigationReport, Report
from fleet.wire.databus import decode_report
from fleet.wire.missions import decode_mission, document_in, run_of
from fleet.wire.rules import Kind
from fleet.wire.strict_json import without_nulls

NEW = 1.0  # s; an older run was resumed after a restart of the edge
STATES: Mapping[str, ActionState] = {
    RunOutcome.COMPLETED: ActionState.COMPLETED,
    RunOutcome.WITH_LOSSES: ActionState.COMPLETED,
    RunOutcome.FAILED: ActionState.FAILED,
    RunOutcome.UNDONE: ActionState.FAILED,
    RunOutcome.UNDO_FAILED: ActionState.FAILED,
    RunOutcome.ABORTED: ActionState.CANCELLED,
    RunOutcome.UNKNOWN: ActionState.FAILED,
}
"""End of a run as a state of the contract; its ``message`` has the exact outcome."""


class TwinPlans:
    """Plans of the twins of one edge. All mappings are by robot name.

    ``publish`` has the report senders, ``max_age`` the greatest age of a start (s), ``record`` writes the
    history.
    """

    def __init__(
        self,
        runs: Runs,
        starts: StartRequests,
        publish: Mapping[str, Callable[[Report], None]],
        policies: Mapping[str, SourcePolicy],
        *,
        max_age: Mapping[str, float],
        record: Callable[[str, EventReport], None],
        soon: Callable[[Callable[[], None]], None],
        clock: Clock,
    ) -> None:
        self._runs, self._starts, self._publish, self._policies = runs, starts, publish, policies
        self._max_age, self._record, self._soon, self._clock = max_age, record, soon, clock
        self._pilots: dict[str, list[str]] = {}
        self._items: dict[str, int] = {}
        self._last: dict[str, tuple[ActionState, str]] = {}

    def port(self, robot: RobotPort) -> RobotPort:
        """Return a robot in the form for the bridge."""
        return _PlanPort(robot, self)

    # -- status ----------------------------------------------------------------------------------------

    def navigates(self, report: NavigationReport) -> None:
        """Record the present item of a robot; from any thread."""
        run = run_of(report.action_id)
        if run in self._last and report.step is not None:
            self._items[run] = report.step

    def record_item(self, sample: bytes) -> None:
        """Record the present item of a robot in a worker; on the bus's thread."""
        with contextlib.suppress(WireError):
            report = decode_report(NavigationReport.channel, sample)
            if isinstance(report, NavigationReport):
                self.navigates(report)

    def run_changed(self, state: RunState) -> None:
        """Publish changes of a run in which robots fly plans; on the event loop."""
        robots = self._pilots_of(state.run)
        if not robots:
            return
        status = status_of(state)
        if state.run not in self._last and not state.outcome and state.seconds < NEW:
            self._say(robots, state.run, (ActionState.QUEUED, ""))
        if status != self._last.get(state.run):
            self._say(robots, state.run, status)
        if state.outcome:
            for kept in (self._pilots, self._items, self._last):
                kept.pop(state.run, None)

    def _say(self, robots: Sequence[str], run: str, status: tuple[ActionState, str]) -> None:
        """Publish a status."""
        self._last[run] = status
        state, message = status
        report = NavigationReport(self._clock.time(), run, state, 0.0, message, self._items.get(run, 0))
        for robot in robots:
            if publish := self._publish.get(robot):  # else it was removed from the edge
                publish(report)

    def _pilots_of(self, run: str) -> list[str]:
        """Return the robots of this edge that fly plans in a run."""
        found = self._pilots.get(run)
        if found is None:
            made = self._runs.find(run)
            found = pilots(made.engine.program, made.engine.robots.members.values()) if made else []
            self._pilots[run] = found = [robot for robot in found if robot in self._publish]
        return found

    # -- requests --------------------------------------------------------------------------------------

    def read(self, robot: RobotPort, payload: bytes, direct: Request | None) -> Request | None:
        """Return the request for a message; ``direct`` is the request that the robot itself decoded."""
        try:
            request = decode_mission(payload, transport=Transport.CLOUD, twin=robot.twin)
        except WireError:
            return direct  # it reports the error, or stops
        if not isinstance(request, Navigate) or direct is None:
            return direct
        if isinstance(request.instruction, Control):
            return Request(
                partial(self._control, robot, request, request.instruction, direct), direct.stops, direct.once
            )
        start = partial(self._start, robot, request, document_in(payload), self._clock.monotonic())
        return Request(start, once=True)

    def _start(
        self,
        robot: RobotPort,
        request: Navigate,
        document: dict[str, object],
        arrived: float,
        answer: Answer,
    ) -> None:
        """Start a run, unless it is known already; on the event loop."""
        run, origin = request.action_id, request.origin
        tell = partial(self._began, robot, request, answer)
        if robot.name not in self._policies:
            tell("", {}, f"{robot.name} was taken out of this edge")
            return
        if self._clock.monotonic() - arrived > self._max_age[robot.name]:
            tell("", {}, "it waited too long in here: the edge was held up")
            return
        refusal = self._policies[robot.name].refusal(origin, navigation=True)
        if refusal is not None:
            tell("", {}, refusal)
            return

        def made() -> tuple[Mission, MissionStartRequest]:
            check_run_id(run)
            name = str(document.get("name") or "")
            start = MissionStartRequest(
                robots={PILOT: [robot.name]},
                run=run,
                session_id=origin.session,
                source_type=origin.source_type,
                timestamp=request.stamp,
            )
            return mission_of("plan", mission_of_plan(document, f"the plan {name}")), start

        self._starts.begin(made, Transport.CLOUD, tell, admitted=True)

    def _began(  # noqa: PLR0917 - by position
        self,
        robot: RobotPort,
        request: Navigate,
        answer: Answer,
        run: str,
        roles: Mapping[str, Sequence[str]],
        refusal: str,
    ) -> None:
        """Answer the sender of a start; from any thread."""
        if not refusal:
            self._soon(partial(self._accepted, robot, run, not roles, answer))
            return

        def looked(ended: tuple[RunOrigin, RunHead, list[RunMember]] | None) -> None:
            self._soon(partial(self._refused, robot, request, refusal, ended, answer))

        self._runs.store.ended_run(request.action_id, looked)

    def _accepted(self, robot: RobotPort, run: str, repeated: bool, answer: Answer) -> None:  # noqa: FBT001 - by position
        """Accept a start; for a repeat, publish the run's status again."""
        answer(Reply(MISSION, ReplyStatus.ACCEPTED))
        if repeated and run in self._last:
            self._say([robot.name], run, self._last[run])

    def _refused(
        self,
        robot: RobotPort,
        request: Navigate,
        refusal: str,
        ended: tuple[RunOrigin, RunHead, list[RunMember]] | None,
        answer: Answer,
    ) -> None:
        """Refuse a start; for an ended run, publish its end again."""
        run, now = request.action_id, self._clock.time()
        if ended is not None:
            state, message = status_of(ended_state(*ended, self._runs.edge))
            answer(Reply(MISSION, ReplyStatus.ACCEPTED))
        else:
            state, message = ActionState.FAILED, refusal
            answer(Reply(MISSION, ReplyStatus.REJECTED, refusal))
            who = Requester(Transport.CLOUD, request.origin.session, request.origin.source_type)
            text = f"mission refused: {refusal}"
            event = EventReport(now, EventKind.COMMAND, text, Severity.WARNING, who, MISSION, run)
            self._record(robot.name, event)
        self._publish[robot.name](NavigationReport(now, run, state, 0.0, message, 0))

    def _control(
        self, robot: RobotPort, request: Navigate, control: Control, direct: Request, answer: Answer
    ) -> None:
        """Control the run of the message, or else the robot itself; on the event loop."""
        run = self._run_of(robot.name, request.action_id)
        if run is None:
            direct(answer)
            return
        by, on_answer = request.origin.session, partial(_answer_for_mission, answer)
        if control is Control.STOP:
            self._runs.control(run.id, RunControlRequest("abort", session_id=by))
            self._request(robot, {"command": "stop"}, request, on_answer)
        elif control is Control.PAUSE:
            pause = RunControlRequest("pause", session_id=by)
            self._runs.control(run.id, pause, lambda refusal: on_answer(_reply(refusal)))
        else:
            # The robot judges the sender and age of the request, as when it joins a run.
            joins: dict[str, object] = {"command": JOIN, "data": {"run": run.id}}
            self._request(robot, joins, request, partial(self._resume, run, by, on_answer))

    def _resume(self, run: Run, by: str, on_answer: Answer, reply: Reply) -> None:
        """Resume a run that its robot may resume."""
        if not (reply.ok and reply.done):
            if reply.done is not None or not reply.ok:
                on_answer(reply)
            return
        question = run.engine.head.question
        requested = RunControlRequest("resume", session_id=by)
        if question is not None:
            requested = RunControlRequest("answer", question.id, goes_on=True, session_id=by)
        self._runs.control(run.id, requested, lambda refusal: on_answer(_reply(refusal)))

    def _request(
        self, robot: RobotPort, message: dict[str, object], request: Navigate, answer: Answer
    ) -> None:
        """Send a request to a robot in the name of a message's sender."""
        origin: Origin = request.origin
        sender = {"session_id": origin.session, "source_type": origin.source_type, "timestamp": request.stamp}
        payload = msgspec.json.encode(message | without_nulls(sender))
        command = robot.read("command", payload, transport=origin.transport, waits=True)
        if command is not None:
            command(answer)

    def _run_of(self, robot: str, execution: str) -> Run | None:
        """Return the run that a control message means: one of the cloud, of this twin's plan."""
        for run in self._runs.all():
            plan = run.about.transport == Transport.CLOUD and not run.about.workflow
            if plan and robot in run.engine.robots.members and execution in ("", run.id):
                return self._runs.find(run.id)
        return None


class _PlanPort:
    """A robot in the form for the bridge, whose plans run as missions."""

    def __init__(self, robot: RobotPort, plans: TwinPlans) -> None:
        self.name, self.twin = robot.name, robot.twin
        self.source_type, self.legacy_status = robot.source_type, robot.legacy_status
        self._robot = robot
        self._plans = plans

    def read(
        self,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        request_id: str = "",
        waits: bool = False,
        unread: str = "",
    ) -> Request | None:
        """Decode a message, from any thread; an emergency stop is executed at once."""
        requested = self._robot.read(
            kind, payload, transport=transport, request_id=request_id, waits=waits, unread=unread
        )
        if kind != "mission" or unread:
            return requested
        return self._plans.read(self._robot, payload, requested)


def status_of(state: RunState) -> tuple[ActionState, str]:
    """Return a run's status as a state of the contract, with its exact outcome."""
    if state.outcome:
        reason = f": {state.reason}" if state.reason else ""
        return STATES[state.outcome], f"{state.outcome}{reason}"
    if state.question is not None:
        return ActionState.RUNNING, f"asks: {state.question.text}"
    return ActionState.RUNNING, "paused" if state.phase == Phase.PAUSED else ""


def pilots(program: Program, members: Iterable[RunMember]) -> list[str]:
    """Return the robots that fly a plan from their autopilot's memory in a program."""
    found = []
    for member in members:
        acts = (
            act
            for step in program.steps
            if isinstance(step, Do)
            for act in step.acts.get(member.role) or step.acts.get("all") or ()
        )
        if any(act.verb == "plan" for act in acts):
            found.append(member.robot)
    return found


def _reply(refusal: str) -> Reply:
    """Return the reply to a control message."""
    if refusal:
        return Reply(MISSION, ReplyStatus.REJECTED, refusal)
    return Reply(MISSION, ReplyStatus.ACCEPTED, done=True)


def _answer_for_mission(answer: Answer, reply: Reply) -> None:
    """Answer a mission message that was executed as another command."""
    answer(msgspec.structs.replace(reply, command=MISSION))
