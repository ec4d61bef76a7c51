"""``--at``: a coordinated start, in which several robots begin at one instant, or none does.

The clocks of their processes are measured, all robots are prepared, and then the instant is sent to all.
Until that instant, an error of one robot cancels the start of all; so does the end of this process, however
abrupt, by the loss of its liveliness token. Each robot's part is one query with several answers: prepared or
not, receipt, outcome.
"""

from __future__ import annotations

import re
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from typing import Any, Self

import click
import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.client.edges import Edges, decoded
from fleet.client.local_user import stamped
from fleet.errors import Refused
from fleet.model.command import Reply
from fleet.model.common_start import (
    AT_LEAST,
    FARTHEST,
    PINGS,
    ClockOffset,
    StartAnswer,
    StartSignal,
    check_clock,
    offset_of,
)
from fleet.model.state import RobotState
from fleet.robot_config import MAIN

PING_WITHIN = 1.0  # s for one measurement of a clock
SPARE = 0.2  # s before the instant by which every robot must have confirmed it, or none begins

RobotQuestion = tuple[RobotState, str, dict[str, Any]]
"""A robot, the name of the request, and the message, which is stamped when it is sent."""
RobotReplies = tuple[RobotState, str, Iterator[Reply]]

_AHEAD = re.compile(r"\+(\d+(?:\.\d+)?)\s*(s|min)?")


def instant(_context: click.Context, _option: click.Parameter, text: str | None) -> float | None:
    """Return the Unix seconds of ``+2s`` from now or an ISO date with time; None without a value."""
    if text is None:
        return None
    now = time.time()
    found = _AHEAD.fullmatch(text.strip())
    try:
        at = now + float(found[1]) * (60.0 if found[2] == "min" else 1.0) if found else _date(text)
    except (ValueError, OverflowError):
        reason = f"{text!r} is neither like +2s nor a time like 2026-11-22T10:00:00+01:00"
        raise click.BadParameter(reason) from None
    if not AT_LEAST <= at - now <= FARTHEST:
        reason = f"{at - now:.1f} s from now is not {AT_LEAST:g} to {FARTHEST:g} s ahead"
        raise click.BadParameter(reason)
    return at


def _date(text: str) -> float:
    """Return the Unix seconds of an ISO date with a time; local without a zone."""
    return datetime.fromisoformat(text).timestamp()


at_option = click.option(
    "--at",
    "at",
    callback=instant,
    metavar="+2s|TIME",
    help="Begin at one instant, all or none: after a time from now, or at a time (local without a zone).",
)


class CommonStartRequest:
    """A start of several robots; as a context manager it cancels robots that have not started."""

    def __init__(self, edges: Edges, requested: Sequence[RobotQuestion], *, kind: str, at: float) -> None:
        self._id = uuid.uuid4().hex
        self._edges, self._at, self._kind = edges, at, kind
        self._sessions: dict[str, ZenohSession] = {}
        self._requested = requested
        self._tokens: list[Callable[[], None]] = []

    def __enter__(self) -> Self:
        for robot, _, _ in self._requested:
            bus_session = self._edges.session_of(robot)
            if bus_session is None:
                raise Refused(
                    f"{robot.name}: {robot.cause or 'no process reports its state'}: no robot is started"
                )
            if robot.edge not in self._sessions:
                self._sessions[robot.edge] = bus_session
                self._tokens.append(bus_session.token(keys.starting(robot.edge, self._id)))
        return self

    def __exit__(self, *_: object) -> None:
        self._withdraw()

    def _withdraw(self) -> None:
        """Drop the tokens, which cancels robots that have not started."""
        while self._tokens:
            self._tokens.pop()()

    def check_clocks(self) -> None:
        """Raise Refused for processes whose clocks differ from ours."""
        wanted = {(robot.edge, robot.worker or MAIN) for robot, _, _ in self._requested}
        for edge, bus_session in self._sessions.items():
            offsets = _offsets(bus_session, edge)
            for process in sorted(process for of, process in wanted if of == edge):
                where = f"edge {edge}" if process == MAIN else f"worker {process} of edge {edge}"
                check_clock(where, offsets.get(process))

    def run(self, *, wait: bool, within: float) -> tuple[list[RobotReplies], dict[str, str]]:
        """Prepare all robots and send the instant; return the pending answers, and errors by robot.

        After any error no robot begins, and their answers say so.
        """
        answers, problems = _first_answers(self._prepared(wait=wait, within=within))
        if not problems:
            problems = self._send_instant()
        if problems:
            self._withdraw()
        return answers, problems

    def _prepared(self, *, wait: bool, within: float) -> list[RobotReplies]:
        """Send the preparation to all robots."""
        parameters = {"kind": self._kind, "wait": "1" if wait else "0", "start": self._id}
        last = self._at - time.time() + within
        requested: list[RobotReplies] = []
        for robot, command, message in self._requested:
            bus_session = self._sessions[robot.edge]
            key = keys.as_person(keys.prepare(robot.edge, robot.name), bus_session.person)
            answers = bus_session.request(key, stamped(message), timeout=last, parameters=parameters)
            requested.append((robot, command, (reply for _, reply in decoded(answers, Reply))))
        return requested

    def _send_instant(self) -> dict[str, str]:
        """Send the instant to all processes; return errors by robot, also for a missing confirmation."""
        left = self._at - SPARE - time.time()
        if left <= 0:
            late = f"it took until {-left:.1f} s too late to prepare all; name a later time"
            return {robot.name: late for robot, _, _ in self._requested}
        requested = msgspec.json.encode(StartSignal(self._id, self._at))
        all_answers = [
            bus_session.request(keys.starts(edge), requested, timeout=left)
            for edge, bus_session in self._sessions.items()
        ]
        found: dict[str, str] = {}
        for edge, answers in zip(self._sessions, all_answers, strict=True):
            for _, answer in decoded(answers, StartAnswer):
                found |= {f"{edge}/{name}": why for name, why in answer.robots.items()}
        unheard = "its process did not take the instant in time"
        problems = {r.name: found.get(f"{r.edge}/{r.name}", unheard) for r, _, _ in self._requested}
        if time.time() > self._at - SPARE / 2 and not any(problems.values()):
            problems[self._requested[0][0].name] = "the instant came before all had taken it"
        return {name: why for name, why in problems.items() if why}


def _first_answers(requested: Iterable[RobotReplies]) -> tuple[list[RobotReplies], dict[str, str]]:
    """Wait until every robot is prepared; return the pending answers, and errors by robot."""
    answers, problems = [], {}
    for robot, command, replies in requested:
        reply = next(replies, None)
        rest = replies
        if reply is None:
            problems[robot.name] = robot.cause or "it does not answer"
        elif not reply.ok:
            problems[robot.name] = reply.reason
            rest = iter((msgspec.structs.replace(reply, command=command),))
        answers.append((robot, command, rest))
    return answers, problems


def _offsets(bus_session: ZenohSession, edge: str) -> dict[str, ClockOffset]:
    """Return the clock offsets of an edge's processes, by the fastest of several measurements."""
    best: dict[str, ClockOffset] = {}
    requested = msgspec.json.encode(StartSignal())
    for _ in range(PINGS):
        sent = time.time()
        for _, answer in decoded(
            bus_session.request(keys.starts(edge), requested, timeout=PING_WITHIN), StartAnswer
        ):
            offset = offset_of(sent, answer.time, time.time())
            known = best.get(answer.process)
            if known is None or offset.bound < known.bound:
                best[answer.process] = offset
    return best
