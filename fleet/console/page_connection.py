"""One open page: a WebSocket that receives changes, and sends the requests of its operator."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from typing import TYPE_CHECKING, Any

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from fleet.console import commands, control, missions, schedules
from fleet.console.driving import Driving
from fleet.console.lookups import Lookups
from fleet.console.requests import (
    AnsweredRequest,
    PageCommandRequest,
    PageControlRequest,
    PageDriveRequest,
    PageGiveRequest,
    PageGotoRequest,
    PageMissionRequest,
    PagePingRequest,
    PageRehearseRequest,
    PageReleaseRequest,
    PageRequest,
    PageRunRequest,
    PageStopRequest,
    PageWatchRequest,
    ScheduleChange,
    needed_for,
    read_requested,
)
from fleet.console.sessions import ConsoleUser
from fleet.console.stops import StopTarget
from fleet.errors import FleetError, Refused, WireError
from fleet.model.command import Reply, ReplyStatus
from fleet.version import __version__

if TYPE_CHECKING:
    from fleet.console.hub import Hub

log = logging.getLogger(__name__)

MOST_OPEN = 64  # requests of one page in progress
MOST_BAD = 16  # unreadable messages after which a page is closed
UNREADABLE = 1007  # close code of RFC 6455: inconsistent data
TOO_MANY = "too many requests are under way"

Call = Callable[[Any], Awaitable[None]]


class PageConnection:
    """One page of an operator. ``watched`` is the robot that it shows in detail, empty for none."""

    def __init__(self, socket: WebSocket, hub: Hub, operator: ConsoleUser) -> None:
        self.watched = ""
        self._socket = socket
        self._hub = hub
        self._operator = operator
        self._open: set[asyncio.Task[None]] = set()
        self._sending = asyncio.Lock()
        self._lookups = Lookups(hub)
        self._driving = Driving(operator, hub.edges.session_to, hub.clock, self._drove)
        self._calls: Mapping[type[object], Call] = {
            PageStopRequest: self._stop,
            PageReleaseRequest: self._command,
            PageGotoRequest: self._command,
            PageCommandRequest: self._command,
            PageMissionRequest: self._mission,
            PageRehearseRequest: self._rehearse,
            PageRunRequest: self._run,
            PageControlRequest: self._control,
            PageGiveRequest: self._give,
            ScheduleChange: self._schedule,
            **dict.fromkeys(self._lookups.calls, self._answer_read),
        }

    async def run(self) -> None:
        """Serve the page until either side closes it."""
        feeding = asyncio.create_task(self._feed(), name="tab:feed")
        try:
            await self._listen()
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._driving.end()
            for task in (feeding, *self._open):
                task.cancel()
            await asyncio.gather(feeding, *self._open, return_exceptions=True)

    async def _feed(self) -> None:
        """Send the changes at each tick; a slow page only misses ticks."""
        seen = 0
        await self._send(_hello(self._operator))
        while True:
            message, seen = self._hub.updates_since(seen)
            if message:
                await self._send(message)
            await self._hub.next_tick()

    async def _send(self, message: bytes) -> None:
        """Send one message; waits while the page does not read."""
        async with self._sending:
            await self._socket.send_text(message.decode())

    async def _reply(self, request: str, robot: str, result: Mapping[str, object]) -> None:
        """Answer a request; a closed page needs no answer."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            answer = {"type": "answer", "request": request, "robot": robot, **result}
            await self._send(msgspec.json.encode(answer))

    async def _listen(self) -> None:
        """Receive the requests of the page."""
        bad = 0
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                await self._begin_request(read_requested(message.get("text") or message.get("bytes") or b""))
            except WireError as error:
                bad += 1
                await self._reply("", "", {"status": "rejected", "reason": f"it cannot be read: {error}"})
                if bad >= MOST_BAD:
                    await self._socket.close(UNREADABLE)
                    return

    async def _begin_request(self, requested: PageRequest) -> None:
        """Begin a request, if this operator has the permission."""
        if isinstance(requested, PagePingRequest):
            await self._send(msgspec.json.encode({"type": "pong", "number": requested.number}))
            return
        if why := self._operator.permission.refusal(needed_for(requested)):
            await self._reply(getattr(requested, "request", ""), "", {"status": "rejected", "reason": why})
        elif isinstance(requested, PageWatchRequest):
            self.watched = requested.robot
            self._hub.edges.queries.request_description(requested.robot)
        elif isinstance(requested, PageDriveRequest):
            self._driving.drive(requested)
        elif len(self._open) >= MOST_OPEN and not isinstance(requested, PageStopRequest):
            await self._reply(requested.request, "", {"status": "rejected", "reason": TOO_MANY})
        else:
            self._begin(self._guarded(requested))

    def _drove(self, result: Mapping[str, object]) -> None:
        """Send the answer to a velocity to the page."""
        self._begin(self._send(msgspec.json.encode(result)))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Run work concurrently with the receiving."""
        task = asyncio.create_task(work)
        self._open.add(task)
        task.add_done_callback(self._open.discard)

    async def _guarded(self, requested: AnsweredRequest) -> None:
        """Execute a request; an exception becomes its answer."""
        try:
            await self._calls[type(requested)](requested)
        except FleetError as error:
            await self._reply(requested.request, "", commands.refused(error))
        except Exception as error:
            log.exception("a request of a page failed")
            result = {"status": "rejected", "reason": f"the console failed: {error!r}"}
            await self._reply(requested.request, "", result)

    async def _stop(self, requested: PageStopRequest) -> None:
        """Stop robots. It continues if the page is closed."""
        stop = self._hub.stop(StopTarget(requested.robots), self._operator, requested.why, requested.request)
        result = await asyncio.shield(stop)
        await self._reply(requested.request, "", {"status": "accepted", "stop": result})

    async def _command(self, requested: PageReleaseRequest | PageGotoRequest | PageCommandRequest) -> None:
        """Send a command to robots concurrently, and forward each answer as it arrives."""
        prepared = commands.prepare(requested, self._hub.view)
        await asyncio.gather(*(self._request(requested.request, each) for each in prepared))

    async def _request(self, request: str, prepared: commands.Prepared) -> None:
        """Send a command to one robot."""
        robot = prepared[0]
        name = f"{robot.edge}/{robot.name}"
        bus_session = self._hub.edges.session_to(robot.edge)
        if bus_session is None:
            raise Refused(f"{name} cannot be asked: no edge is reached")
        async for reply in commands.send(prepared, bus_session, self._operator, self._hub.clock):
            await self._reply(request, name, _shown(reply))

    async def _answer_read(self, requested: AnsweredRequest) -> None:
        """Answer a read-only request."""
        found = await self._lookups.calls[type(requested)](requested)
        await self._reply(requested.request, "", {"status": "accepted", **found})

    async def _mission(self, requested: PageMissionRequest) -> None:
        """Start a mission."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        start = asyncio.to_thread(missions.start, requested, bus_sessions, self._operator, self._hub.clock)
        await self._reply(requested.request, "", await start)

    async def _rehearse(self, requested: PageRehearseRequest) -> None:
        """Rehearse a mission; closing the page ends it."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        async for state in missions.rehearse(requested, bus_sessions, self._operator):
            done = {} if state.result is None else {"done": True}
            result = {"status": "accepted", "rehearsal": msgspec.to_builtins(state), **done}
            await self._reply(requested.request, "", result)

    async def _run(self, requested: PageRunRequest) -> None:
        """Control a run."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        control = asyncio.to_thread(missions.control, requested, bus_sessions, self._operator)
        await self._reply(requested.request, "", await control)

    async def _control(self, requested: PageControlRequest) -> None:
        """Request control of a robot."""
        result = control.requested(requested, self._hub.view, self._operator, self._hub.clock.time())
        self._hub.view.put("requests", requested.robot, result)
        await self._reply(requested.request, "", {"status": "accepted"})

    async def _give(self, requested: PageGiveRequest) -> None:
        """Give up control of a robot, or keep it."""
        answered = control.answered(requested, self._hub.view, self._operator)
        if requested.give:
            await self._command(PageCommandRequest(requested.request, requested.robot, "stop"))
        self._hub.view.put("requests", requested.robot, answered)
        await self._reply(requested.request, "", {"status": "accepted", "done": True})

    async def _schedule(self, requested: ScheduleChange) -> None:
        """Change a schedule."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        found = await asyncio.to_thread(schedules.change, requested, bus_sessions, self._operator)
        self._hub.view.update_schedules(requested.edge, found)
        await self._reply(requested.request, "", {"status": "accepted", "done": True})


def _hello(operator: ConsoleUser) -> bytes:
    """Return the first message to a page."""
    result = {
        "type": "hello",
        "version": __version__,
        "operator": operator.name,
        "permission": operator.permission.word,
    }
    return msgspec.json.encode(result)


def _shown(reply: Reply) -> dict[str, object]:
    """Return a reply for a page."""
    return {
        "command": reply.command,
        "status": reply.status.value,
        "reason": reply.reason,
        "hint": reply.hint,
        "done": reply.done,
        "final": reply.done is not None or reply.status is not ReplyStatus.ACCEPTED,
        "data": reply.data,
    }
