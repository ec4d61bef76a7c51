"""Commands from the console: the same messages as from any local program, with the operator's name.

They pass through the edge's admission. Only facts known to the page alone are checked here.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Iterable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.console.fleet_view import FleetView, id_of
from fleet.console.requests import PageCommandRequest, PageGotoRequest, PageReleaseRequest
from fleet.console.sessions import ConsoleUser
from fleet.errors import CommandError, FleetError, Refused
from fleet.history.event_filter import MOST, EventFilter, newest
from fleet.history.record import Record
from fleet.history.stop_causes import stop_causes
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState
from fleet.runtime.decoding import decode_json
from fleet.wire.goals import GotoTarget, goals
from fleet.wire.rules import Kind

END_WITHIN = 300.0  # s until a command must be seen done
SHOWN = 30  # events of a robot
HISTORY_WITHIN = 5.0  # s for answers that an edge reads from its disk

Prepared = tuple[RobotState, Kind, Mapping[str, object]]
"""Robot, kind of message, and message."""


def prepare(
    requested: PageGotoRequest | PageCommandRequest | PageReleaseRequest, view: FleetView
) -> list[Prepared]:
    """Return the message for each robot; raises Refused for unknown robots, and for an invalid goal."""
    names = (requested.robot,) if isinstance(requested, PageCommandRequest) else requested.robots
    robots = view.named(names)
    if not names or len(robots) != len(set(names)):
        missing = ", ".join(name for name in names if name not in view.states)
        raise Refused(f"there is no robot {missing}" if missing else "no robot is named")
    if isinstance(requested, PageCommandRequest):
        return [(robots[0], "command", {"command": requested.command, "data": requested.data})]
    if isinstance(requested, PageReleaseRequest):
        return [(robot, "command", {"command": RELEASE, "data": {}}) for robot in robots]
    return [
        (robot, "navigate", message) for robot, message in zip(robots, _goals(requested, robots), strict=True)
    ]


def _goals(requested: PageGotoRequest, robots: list[RobotState]) -> list[dict[str, object]]:
    """Return the goal of each robot; without a height, each keeps its own. Raises Refused."""
    made = goals(GotoTarget(requested.x, requested.y, requested.z, "site", spacing=requested.spacing), robots)
    for robot, message in zip(robots, made, strict=True):
        place = message["position"]
        if requested.z is None and robot.position is not None and isinstance(place, list):
            message["position"] = [*place[:2], robot.position.z]
    return made


def _hand_over(
    loop: asyncio.AbstractEventLoop, replies: asyncio.Queue[bytes | None], data: bytes | None
) -> None:
    """Pass an answer, or None for the end of the answers, to the loop; on the bus's thread."""
    with contextlib.suppress(RuntimeError):  # the loop has ended
        loop.call_soon_threadsafe(replies.put_nowait, data)


async def send(
    prepared: Prepared, bus_session: ZenohSession, operator: ConsoleUser, clock: Clock
) -> AsyncIterator[Reply]:
    """Send a command to a robot; yield its receipt and outcome, or one timeout without an answer."""
    robot, kind, message = prepared
    name = str(message["command"])
    try:
        payload = json.dumps(
            {**message, "session_id": operator.name, "timestamp": clock.time()}, allow_nan=False
        ).encode()
    except ValueError:
        yield Reply(name, ReplyStatus.REJECTED, "a number in the command is not finite")
        return
    loop = asyncio.get_running_loop()
    replies: asyncio.Queue[bytes | None] = asyncio.Queue()
    bus_session.request_later(
        keys.as_console(keys.command(robot.edge, robot.name), operator.permission.word, bus_session.identity),
        payload,
        timeout=END_WITHIN,
        parameters={"kind": kind, "wait": "1"},
        on_answer=partial(_hand_over, loop, replies),
        on_end=partial(_hand_over, loop, replies, None),
    )
    heard = False
    while (data := await replies.get()) is not None:
        try:
            reply = decode_json(data, Reply)
        except msgspec.DecodeError as error:
            reply = Reply(name, ReplyStatus.TIMEOUT, f"its answer cannot be read: {error}")
        heard = True
        yield reply
    if not heard:
        yield Reply(name, ReplyStatus.TIMEOUT, robot.cause or "its process does not answer")


def causes(bus_sessions: Iterable[ZenohSession], robots: list[RobotState]) -> dict[str, dict[str, object]]:
    """Return who set the stop of each robot, when and why, by identity; blocks."""
    names = tuple({robot.name for robot in robots})
    found = stop_causes(_records(bus_sessions, "*", EventFilter(names, 0.0, MOST)))
    return {id_of(edge, name): _shown(record) for (edge, name), record in found.items()}


def history(bus_sessions: Iterable[ZenohSession], robot: str) -> list[dict[str, object]]:
    """Return the recent events of a robot, newest first; blocks."""
    edge, _, name = robot.rpartition("/")
    found = _records(bus_sessions, edge, EventFilter((name,), 0.0, SHOWN))
    return [shown_event(record) for record in reversed(found)]


def shown_event(record: Record) -> dict[str, object]:
    """Return an event for a page."""
    return _shown(record) | {"kind": record.kind.value, "text": record.text}


def _records(bus_sessions: Iterable[ZenohSession], edge: str, wanted: EventFilter) -> list[Record]:
    """Return the events of edges, without duplicates, oldest first; blocks."""
    found: list[Record] = []
    for bus_session in bus_sessions:
        for key, data in bus_session.request(
            keys.history(edge), msgspec.json.encode(wanted), timeout=HISTORY_WITHIN
        ):
            edge_name = key.split("/")[1]
            found += [
                msgspec.structs.replace(each, edge=edge_name) for each in decode_json(data, list[Record])
            ]
    return newest(found, wanted)


def _shown(record: Record) -> dict[str, object]:
    """Return requester, time and reason of an event, for a page."""
    return {
        "by": record.asker.name if record.asker else "",
        "proven": bool(record.asker and record.asker.proven),
        "at": record.stamp,
        "why": str(record.data.get("reason") or record.text),
    }


def refused(error: FleetError) -> dict[str, object]:
    """Return an error for a page."""
    reason = error.reason if isinstance(error, CommandError) else str(error)
    hint = error.hint if isinstance(error, CommandError) else ""
    return {"status": ReplyStatus.REJECTED.value, "reason": reason, "hint": hint}
