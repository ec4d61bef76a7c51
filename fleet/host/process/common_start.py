"""Starts robots together: each prepares what it is asked, then all begin at one instant.

To prepare is to find out everything that can be found out before: who asks, what stands against it, whether
the robot is ready, whether its way is free also of the ways that others are prepared for. Nothing moves by
it. What is prepared is dropped, and never taken up again, when who asked for it is gone (the liveliness token
of the start), when anything stops or moves the robot, when it is lost, and when the instant is not met. One
of a start that is dropped takes all others of this process with it; whoever asked does the same for the
other processes, until the instant. Runs on the event loop, but for what the bus calls.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import cast

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query
from fleet.errors import WireError
from fleet.host.process.permitted_requests import PermittedRequests
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.answering import answer_to
from fleet.host.requests.decode import Ask
from fleet.host.requests.event_reporter import with_proof
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.dry_run import against
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.motion_guard import BEGINNINGS
from fleet.model.command import Command, JointSetpoint, Reply, ReplyStatus, Setpoint, Transport
from fleet.model.navigation import Control, Navigate
from fleet.model.start import FARTHEST, StartAnswer, StartAsked
from fleet.robot_config import MAIN
from fleet.runtime.decoding import decode_json
from fleet.wire.rules import Kind
from fleet.wire.stops import STOP_WORDS, stop_in

log = logging.getLogger(__name__)

KEPT = 30.0  # s for which what is prepared waits for its instant to be told
READY_WITHIN = 10.0  # s for a robot to say whether it is ready
LOOK = 0.1  # s between looks at what is prepared
LATE = 0.1  # s after the instant at which nothing begins any more
READY = "check_ready"
KINDS = ("command", "navigate", "mission")


class _Prepared(msgspec.Struct, eq=False):
    """What one robot is prepared for; ``until`` (monotonic s) it waits for its instant, a Unix ``stamp``."""

    start: str
    robot: LocalRobot
    ask: Command | Navigate
    receipt: Receipt
    until: float
    stamp: float | None = None


class CommonStarts:
    """The starts that robots of one process take part in; each robot in one at a time."""

    def __init__(self, process: RobotProcess) -> None:
        self._process = process
        self._loop, self._clock = process.loop, process.clock
        self._permitted = PermittedRequests(process.askers)
        self._prepared: dict[str, _Prepared] = {}
        self._alive: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    def declare(self) -> None:
        """Take what is asked on the bus."""
        edge, control = self._process.edge, self._process.bus.control

        def serve(robot: LocalRobot) -> Callable[[], None]:
            robot.controller.event_reporter.heard = partial(self._interrupted, robot.name)
            asked = partial(self._asked_to_prepare, robot)
            return control.answer(keys.prepare(edge, robot.name), asked, more=keys.ASKER)

        self._process.services.append(serve)
        control.answer(keys.starts(edge), self._asked)
        control.watch_tokens(keys.starting(edge, "*"), self._token)
        self._process.scheduler.every(LOOK, self._look)

    # -- the bus's threads -----------------------------------------------------------------------------

    def _asked_to_prepare(self, robot: LocalRobot, question: Query) -> None:
        """Take a question to prepare a robot; one that is a stop is obeyed at once."""
        kind = question.parameters.get("kind", "command")
        if not stop_in(question.payload, cast("Kind", kind) if kind in KINDS else "command"):
            self._loop.call_soon_threadsafe(self._begin_to_prepare, robot, question)
            return
        read = cast("Kind", kind if kind in KINDS else "command")
        proven = self._process.askers.proven(question)
        take = robot.read(read, question.payload, way=Transport.BUS, proven=proven)
        if take is not None:
            self._loop.call_soon_threadsafe(take, answer_to(question, waits=False))

    def _asked(self, question: Query) -> None:
        """Answer what the time is, there and then; take the instant of a start."""
        try:
            asked = decode_json(question.payload, StartAsked)
        except msgspec.DecodeError as error:
            log.warning("a start that cannot be read: %s", error)
            question.close()
            return
        if asked.id:
            self._loop.call_soon_threadsafe(self._set, question, asked)
        else:
            self._answer(question, {})

    def _token(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus calls it so
        """Take note of who asks for a start, or is gone."""
        self._loop.call_soon_threadsafe(self._shows, key.rpartition("/")[2], alive)

    def _answer(self, question: Query, robots: dict[str, str]) -> None:
        """Answer with the time, and what became of robots."""
        answer = StartAnswer(self._process.worker or MAIN, self._clock.time(), robots)
        question.reply(msgspec.json.encode(answer))
        question.close()

    # -- to prepare ------------------------------------------------------------------------------------

    def _begin_to_prepare(self, robot: LocalRobot, question: Query) -> None:
        """Prepare a robot, in a task of its own: it may have to be asked."""
        task = self._loop.create_task(self._prepare(robot, question), name=f"prepare:{robot.name}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _prepare(self, robot: LocalRobot, question: Query) -> None:
        """Find out whether a robot can begin, and keep what it is asked; answers either way."""
        waits = question.parameters.get("wait") == "1"
        start = question.parameters.get("start", "")
        answer = answer_to(question, waits=waits)
        name, trouble, ask = "start", "", None
        try:
            ask = _read(robot, question)
            name = ask.name
            trouble = self._permitted.refusal_of(robot, question, ask)
            proven = self._process.askers.proven(question)
            ask = ask if proven is None else with_proof(ask, proven)
            trouble = trouble or self._against(robot, ask, start) or await self._unready(robot, ask)
            trouble = trouble or self._against(robot, ask, start)
        except WireError as error:
            trouble = str(error)
        if trouble or ask is None:
            answer(Reply(name, ReplyStatus.REJECTED, trouble))
            return
        receipt = Receipt(name, answer, waits=waits)
        until = self._clock.monotonic() + KEPT
        self._prepared[robot.name] = _Prepared(start, robot, ask, receipt, until)
        if isinstance(ask, Navigate) and not isinstance(ask.ask, Control):
            robot.controller.guard.means(ask.ask)
        question.reply(msgspec.json.encode(Reply(name, ReplyStatus.ACCEPTED)))

    def _against(self, robot: LocalRobot, ask: Command | Navigate, start: str) -> str:
        """Return why a robot cannot be prepared now; empty when it can."""
        if not start or start not in self._alive:
            return "who asks for the common start does not show that it is there"
        if robot.name in self._prepared:
            return "it is prepared for another start"
        if ask.stamp is not None and abs(self._clock.time() - ask.stamp) > robot.config.command_max_age:
            return f"the message is {self._clock.time() - ask.stamp:.1f} s old"
        return against(robot.controller, ask, robot.spec_of(ask.name))

    async def _unready(self, robot: LocalRobot, ask: Command | Navigate) -> str:
        """Return what a robot says that still stands against its beginning; empty when nothing does."""
        if ask.name not in BEGINNINGS or robot.spec_of(READY) is None:
            return ""
        ended: asyncio.Future[Reply] = self._loop.create_future()

        def told(reply: Reply) -> None:
            if (reply.done is not None or not reply.ok) and not ended.done():
                ended.set_result(reply)

        robot.requests.begin(Command(READY, origin=ask.origin), Receipt(READY, told, waits=True))
        try:
            reply = await asyncio.wait_for(ended, READY_WITHIN)
        except TimeoutError:
            return "it does not say whether it is ready"
        if not reply.done:
            return f"it does not say whether it is ready: {reply.reason}"
        return _words_of(reply.data)

    # -- the instant -----------------------------------------------------------------------------------

    def _set(self, question: Query, asked: StartAsked) -> None:
        """Take the instant of a start, unless anything stands against one of its robots by now."""
        of_it = [one for one in self._prepared.values() if one.start == asked.id]
        ahead = asked.stamp - self._clock.time()
        problems = {one.robot.name: self._hindrance(one, ahead) for one in of_it}
        first = next((f"{name}: {why}" for name, why in problems.items() if why), "")
        for one in of_it:
            if first:
                problems[one.robot.name] = problems[one.robot.name] or f"not without the others: {first}"
                self._drop(one, problems[one.robot.name])
            else:
                one.stamp = asked.stamp
        if of_it and not first:
            self._loop.call_later(ahead, self._begin, asked.id)
        self._answer(question, problems)

    def _hindrance(self, one: _Prepared, ahead: float) -> str:
        """Return why a robot that is prepared cannot begin in so many seconds; empty when it can."""
        if one.start not in self._alive:
            return "who asked for it is gone"
        if one.stamp is not None:
            return "its instant is set already"
        if not 0.0 < ahead <= FARTHEST:
            return (
                f"its instant is {-ahead:.2f} s past" if ahead <= 0 else f"its instant is {ahead:.0f} s ahead"
            )
        return against(one.robot.controller, one.ask, one.robot.spec_of(one.ask.name))

    def _begin(self, start: str) -> None:
        """Begin: bring all that was prepared to the robots' controllers, one after the other, at once."""
        of_it = [one for one in self._prepared.values() if one.start == start and one.stamp is not None]
        for one in of_it:
            self._forget(one)
        for one in of_it:
            assert one.stamp is not None
            off = self._clock.time() - one.stamp
            if abs(off) > LATE:
                self._refuse(one, f"its instant was missed by {off:.2f} s")
                continue
            # It is as old as its start: that is what was agreed upon.
            stamp = None if one.ask.stamp is None else one.stamp
            one.robot.requests.begin(msgspec.structs.replace(one.ask, stamp=stamp), one.receipt)

    # -- what ends it ----------------------------------------------------------------------------------

    def _shows(self, start: str, alive: bool) -> None:  # noqa: FBT001 - by position
        """Take note of who asks for a start; one that is gone starts nothing."""
        if alive:
            self._alive.add(start)
            return
        self._alive.discard(start)
        self._drop_all(lambda one: one.start == start, "who asked for it took it back, or is gone")

    def _interrupted(self, name: str, why: str) -> None:
        """Drop the start of a robot that something else stops, moves or loses, with all its others."""
        one = self._prepared.get(name)
        if one is None:
            return
        self._drop(one, why)
        self._drop_all(lambda other: other.start == one.start, f"not without the others: {name}: {why}")

    def _look(self) -> None:
        """Drop what waits too long, and robots that are lost or stopped."""
        now = self._clock.monotonic()
        for one in list(self._prepared.values()):
            controller = one.robot.controller
            if controller.offline or controller.latched:
                self._interrupted(one.robot.name, controller.offline or "its emergency stop is set")
            elif one.stamp is None and now > one.until:
                self._interrupted(one.robot.name, f"its instant was not told within {KEPT:g} s")

    def _drop_all(self, which: Callable[[_Prepared], bool], why: str) -> None:
        """Drop some of what is prepared."""
        for one in [one for one in self._prepared.values() if which(one)]:
            self._drop(one, why)

    def _drop(self, one: _Prepared, why: str) -> None:
        """Forget what a robot is prepared for, and say why it does not begin."""
        self._forget(one)
        self._refuse(one, why)

    def _forget(self, one: _Prepared) -> None:
        """Forget what a robot is prepared for."""
        self._prepared.pop(one.robot.name, None)
        one.robot.controller.guard.means(None)

    def _refuse(self, one: _Prepared, why: str) -> None:
        """Say that a robot does not begin."""
        one.robot.controller.event_reporter.log.warning("%s is not started: %s", one.ask.name, why)
        one.receipt.reject(f"not started: {why}")


def take_starts(process: RobotProcess) -> None:
    """Let the robots of a process take part in common starts; before they run."""
    CommonStarts(process).declare()


def _read(robot: LocalRobot, question: Query) -> Command | Navigate:
    """Return what a robot is to prepare; raises WireError for what cannot be prepared."""
    kind = question.parameters.get("kind", "command")
    if kind not in KINDS:
        raise WireError(f"{kind[:40]!a} is nothing that is started together; one of {', '.join(KINDS)}")
    way = Transport.CLOUD if question.parameters.get("way") == "cloud" else Transport.BUS
    ask: Ask | None = robot.requests.ask_of(
        cast("Kind", kind), question.payload, way=way, request_id=question.parameters.get("id", "")
    )
    if ask is None or isinstance(ask, Setpoint | JointSetpoint) or ask.name in STOP_WORDS:
        raise WireError("a velocity is not started together: it is obeyed at once")
    return ask


def _words_of(said: object) -> str:
    """Return what stands against a beginning, from the answer to ``check_ready``; empty when it is ready."""
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
