"""Common starts: each robot prepares its request, then all begin at one instant.

To prepare is to check everything that can be checked in advance: the sender, conflicts with the request,
whether the robot is ready, and whether its path is free, also of the prepared paths of others. Nothing moves
meanwhile. A preparation is dropped for good when the sender is gone (the start's liveliness token), when
anything stops or moves the robot, when the robot is lost, and when the instant is missed. Dropping one drops
all others of that start in this process; the sender does the same for the other processes, until the instant.
Runs on the event loop, except for the callbacks of the bus.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import cast

import msgspec

from fleet.bus import keys
from fleet.bus.query_table import QueryTable
from fleet.bus.zenoh_session import Query
from fleet.errors import WireError
from fleet.host.process.permitted_requests import PermittedRequests
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.answering import answer_to
from fleet.host.requests.decode import RobotRequest
from fleet.host.requests.event_reporter import with_proof
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.dry_run import against
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.motion_guard import BEGINNINGS
from fleet.model.command import Command, JointSetpoint, Reply, ReplyStatus, Setpoint, Transport
from fleet.model.common_start import FARTHEST, StartAnswer, StartSignal
from fleet.model.navigation import Control, Navigate
from fleet.robot_config import MAIN
from fleet.runtime.decoding import decode_json
from fleet.wire.rules import Kind
from fleet.wire.stops import STOP_WORDS, stop_in

log = logging.getLogger(__name__)

KEPT = 30.0  # s for which a prepared robot waits for its instant to be set
READY_WITHIN = 10.0  # s for a robot to answer whether it is ready
POLL_INTERVAL = 0.1  # s between checks of prepared robots
LATE = 0.1  # s after the instant at which a start is too late
READY = "check_ready"
KINDS = ("command", "navigate", "mission")


class _PreparedRequest(msgspec.Struct, eq=False):
    """A robot's prepared request; it waits for its instant (Unix ``stamp``) until ``until`` (monotonic s)."""

    start: str
    robot: LocalRobot
    request: Command | Navigate
    receipt: Receipt
    until: float
    stamp: float | None = None


class _PrepareQueries:
    """The queries to prepare the robots of one process; a robot's events are told to ``interrupted``."""

    def __init__(
        self,
        process: RobotProcess,
        requested: Callable[[LocalRobot, Query], None],
        interrupted: Callable[[str, str], None],
    ) -> None:
        self._edge, self._interrupted = process.edge, interrupted
        control, pattern = process.bus.control, keys.prepare(process.edge, "*")
        self._table = QueryTable(
            control, pattern, requested, more=keys.SENDER_SUFFIX, apart=not process.alone
        )

    def join(self, robot: LocalRobot) -> None:
        """Take requests to prepare a robot."""
        robot.controller.event_reporter.heard = partial(self._interrupted, robot.name)
        self._table.add(keys.prepare(self._edge, robot.name), robot)

    def leave(self, robot: LocalRobot) -> None:
        """Stop accepting requests to prepare a robot."""
        self._table.remove(keys.prepare(self._edge, robot.name))


class CommonStarts:
    """Starts with robots of one process; a robot takes part in one at a time."""

    def __init__(self, process: RobotProcess) -> None:
        self._process = process
        self._loop, self._clock = process.loop, process.clock
        self._permitted = PermittedRequests(process.senders)
        self._prepared: dict[str, _PreparedRequest] = {}
        self._alive: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    def declare(self) -> None:
        """Serve the requests for common starts on the bus."""
        edge, control = self._process.edge, self._process.bus.control
        self._process.services.append(
            _PrepareQueries(self._process, self._requested_to_prepare, self._interrupted)
        )
        control.declare_queryable(keys.starts(edge), self._requested)
        control.watch_tokens(keys.starting(edge, "*"), self._token)
        self._process.scheduler.every(POLL_INTERVAL, self._drop_stale)

    # -- the bus's threads -----------------------------------------------------------------------------

    def _requested_to_prepare(self, robot: LocalRobot, question: Query) -> None:
        """Receive a request to prepare a robot; a stop is executed at once."""
        kind = question.parameters.get("kind", "command")
        if not stop_in(question.payload, cast("Kind", kind) if kind in KINDS else "command"):
            self._loop.call_soon_threadsafe(self._begin_to_prepare, robot, question)
            return
        read = cast("Kind", kind if kind in KINDS else "command")
        proven = self._process.senders.proven(question)
        request = robot.read(read, question.payload, transport=Transport.BUS, proven=proven)
        if request is not None:
            self._loop.call_soon_threadsafe(request, answer_to(question, waits=False))

    def _requested(self, question: Query) -> None:
        """Answer with the present time, at once; set the instant of a start."""
        try:
            requested = decode_json(question.payload, StartSignal)
        except msgspec.DecodeError as error:
            log.warning("a start that cannot be read: %s", error)
            question.close()
            return
        if requested.id:
            self._loop.call_soon_threadsafe(self._set, question, requested)
        else:
            self._answer(question, {})

    def _token(self, key: str, alive: bool) -> None:  # noqa: FBT001 - signature of the bus
        """Record that a start's sender appeared or is gone."""
        self._loop.call_soon_threadsafe(self._shows, key.rpartition("/")[2], alive)

    def _answer(self, question: Query, robots: dict[str, str]) -> None:
        """Answer with the present time and the results by robot."""
        answer = StartAnswer(self._process.worker or MAIN, self._clock.time(), robots)
        question.reply(msgspec.json.encode(answer))
        question.close()

    # -- preparation -----------------------------------------------------------------------------------

    def _begin_to_prepare(self, robot: LocalRobot, question: Query) -> None:
        """Prepare a robot in a new task, since the robot itself may be asked."""
        task = self._loop.create_task(self._prepare(robot, question), name=f"prepare:{robot.name}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _prepare(self, robot: LocalRobot, question: Query) -> None:
        """Check whether a robot can begin, and keep its request if so; answers in both cases."""
        waits = question.parameters.get("wait") == "1"
        start = question.parameters.get("start", "")
        answer = answer_to(question, waits=waits)
        name, trouble, request = "start", "", None
        try:
            request = _read(robot, question)
            name = request.name
            trouble = self._permitted.refusal_of(robot, question, request)
            proven = self._process.senders.proven(question)
            request = request if proven is None else with_proof(request, proven)
            trouble = trouble or self._against(robot, request, start) or await self._unready(robot, request)
            trouble = trouble or self._against(robot, request, start)
        except WireError as error:
            trouble = str(error)
        if trouble or request is None:
            answer(Reply(name, ReplyStatus.REJECTED, trouble))
            return
        receipt = Receipt(name, answer, waits=waits)
        until = self._clock.monotonic() + KEPT
        self._prepared[robot.name] = _PreparedRequest(start, robot, request, receipt, until)
        if isinstance(request, Navigate) and not isinstance(request.instruction, Control):
            robot.controller.guard.reserve_path(request.instruction)
        question.reply(msgspec.json.encode(Reply(name, ReplyStatus.ACCEPTED)))

    def _against(self, robot: LocalRobot, request: Command | Navigate, start: str) -> str:
        """Return why a robot cannot be prepared now; empty when it can."""
        if not start or start not in self._alive:
            return "the sender of the common start is not present"
        if robot.name in self._prepared:
            return "it is prepared for another start"
        if (
            request.stamp is not None
            and abs(self._clock.time() - request.stamp) > robot.config.command_max_age
        ):
            return f"the message is {self._clock.time() - request.stamp:.1f} s old"
        return against(robot.controller, request, robot.spec_of(request.name))

    async def _unready(self, robot: LocalRobot, request: Command | Navigate) -> str:
        """Return why the robot itself reports that it is not ready; empty when it is."""
        if request.name not in BEGINNINGS or robot.spec_of(READY) is None:
            return ""
        ended: asyncio.Future[Reply] = self._loop.create_future()

        def on_reply(reply: Reply) -> None:
            if (reply.done is not None or not reply.ok) and not ended.done():
                ended.set_result(reply)

        robot.requests.begin(Command(READY, origin=request.origin), Receipt(READY, on_reply, waits=True))
        try:
            async with asyncio.timeout(READY_WITHIN):
                reply = await ended
        except TimeoutError:
            return "it does not say whether it is ready"
        if not reply.done:
            return f"it does not say whether it is ready: {reply.reason}"
        return _words_of(reply.data)

    # -- the instant -----------------------------------------------------------------------------------

    def _set(self, question: Query, requested: StartSignal) -> None:
        """Set the instant of a start, unless one of its robots can no longer begin."""
        of_it = [one for one in self._prepared.values() if one.start == requested.id]
        ahead = requested.stamp - self._clock.time()
        problems = {one.robot.name: self._blocker(one, ahead) for one in of_it}
        first = next((f"{name}: {why}" for name, why in problems.items() if why), "")
        for one in of_it:
            if first:
                problems[one.robot.name] = problems[one.robot.name] or f"not without the others: {first}"
                self._drop(one, problems[one.robot.name])
            else:
                one.stamp = requested.stamp
        if of_it and not first:
            self._loop.call_later(ahead, self._begin, requested.id)
        self._answer(question, problems)

    def _blocker(self, one: _PreparedRequest, ahead: float) -> str:
        """Return why a prepared robot cannot begin in ``ahead`` seconds; empty when it can."""
        if one.start not in self._alive:
            return "its sender is gone"
        if one.stamp is not None:
            return "its instant is set already"
        if not 0.0 < ahead <= FARTHEST:
            return (
                f"its instant is {-ahead:.2f} s past" if ahead <= 0 else f"its instant is {ahead:.0f} s ahead"
            )
        return against(one.robot.controller, one.request, one.robot.spec_of(one.request.name))

    def _begin(self, start: str) -> None:
        """Begin: pass all prepared requests of a start to the robots' controllers, one after another."""
        of_it = [one for one in self._prepared.values() if one.start == start and one.stamp is not None]
        for one in of_it:
            self._forget(one)
        for one in of_it:
            assert one.stamp is not None
            off = self._clock.time() - one.stamp
            if abs(off) > LATE:
                self._refuse(one, f"its instant was missed by {off:.2f} s")
                continue
            # the agreed instant counts as the time of the request
            stamp = None if one.request.stamp is None else one.stamp
            one.robot.requests.begin(msgspec.structs.replace(one.request, stamp=stamp), one.receipt)

    # -- cancellation ----------------------------------------------------------------------------------

    def _shows(self, start: str, alive: bool) -> None:  # noqa: FBT001 - by position
        """Record whether a start's sender is present; without it nothing of the start remains."""
        if alive:
            self._alive.add(start)
            return
        self._alive.discard(start)
        self._drop_all(lambda one: one.start == start, "its sender cancelled it, or is gone")

    def _interrupted(self, name: str, why: str) -> None:
        """Drop a start of which one robot is stopped, moved or lost by something else."""
        one = self._prepared.get(name)
        if one is None:
            return
        self._drop(one, why)
        self._drop_all(lambda other: other.start == one.start, f"not without the others: {name}: {why}")

    def _drop_stale(self) -> None:
        """Drop preparations that wait too long, and those of robots that are lost or stopped."""
        now = self._clock.monotonic()
        for one in list(self._prepared.values()):
            controller = one.robot.controller
            if controller.offline or controller.latched:
                self._interrupted(one.robot.name, controller.offline or "its emergency stop is set")
            elif one.stamp is None and now > one.until:
                self._interrupted(one.robot.name, f"its start time did not arrive within {KEPT:g} s")

    def _drop_all(self, which: Callable[[_PreparedRequest], bool], why: str) -> None:
        """Drop the preparations that match."""
        for one in [one for one in self._prepared.values() if which(one)]:
            self._drop(one, why)

    def _drop(self, one: _PreparedRequest, why: str) -> None:
        """Drop a preparation and report why the robot does not begin."""
        self._forget(one)
        self._refuse(one, why)

    def _forget(self, one: _PreparedRequest) -> None:
        """Remove a preparation."""
        self._prepared.pop(one.robot.name, None)
        one.robot.controller.guard.reserve_path(None)

    def _refuse(self, one: _PreparedRequest, why: str) -> None:
        """Report that a robot does not begin."""
        one.robot.controller.event_reporter.log.warning("%s is not started: %s", one.request.name, why)
        one.receipt.reject(f"not started: {why}")


def serve_common_starts(process: RobotProcess) -> None:
    """Make the robots of a process available for common starts; before they run."""
    CommonStarts(process).declare()


def _read(robot: LocalRobot, question: Query) -> Command | Navigate:
    """Return the request that a robot is to prepare; raises WireError for one that cannot be prepared."""
    kind = question.parameters.get("kind", "command")
    if kind not in KINDS:
        raise WireError(f"{kind[:40]!a} is nothing that is started together; one of {', '.join(KINDS)}")
    transport = Transport.CLOUD if question.parameters.get("way") == "cloud" else Transport.BUS
    request: RobotRequest | None = robot.requests.decode_request(
        cast("Kind", kind),
        question.payload,
        transport=transport,
        request_id=question.parameters.get("id", ""),
    )
    if request is None or isinstance(request, Setpoint | JointSetpoint) or request.name in STOP_WORDS:
        raise WireError("a velocity is not started together: it is obeyed at once")
    return request


def _words_of(said: object) -> str:
    """Return why a robot is not ready, from its reply to ``check_ready``; empty when it is."""
    if not isinstance(said, dict):
        return "it does not say whether it is ready"
    if said.get("ready") is True:
        return ""
    checks = said.get("checks")
    words = [
        f"{check.get('check')}: {'; '.join(map(str, check.get('words') or ['no']))}"
        for check in (checks if isinstance(checks, list) else ())
        if isinstance(check, dict) and not check.get("ok")
    ]
    return f"not ready: {', '.join(words) or 'it does not say why'}"
