"""Emergency stops from the console: sent on all routes, followed until the robots are seen to stand.

A stop is sent to the edges on the bus and to their supervisors concurrently. Each robot shows the
milliseconds until its stop was set and until it was seen to stand, and the route; a robot without either is
named. A stop does not queue behind other messages, and needs no state of the fleet.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec

from fleet.bus import keys
from fleet.bus.stop_query import ANSWER_WITHIN, query_stop
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.console.fleet_view import FleetView, id_of
from fleet.host.requests.stop_cause import parameters_of
from fleet.model.state import RobotState
from fleet.runtime.decoding import decode_json
from fleet.supervisor.stop_request import stop_all
from fleet.wire.stop_outcome import DONE, OPEN, SEEN_WITHIN, stop_outcome

log = logging.getLogger(__name__)

POLL_INTERVAL = 0.05  # s between polls of the progress
THREADS = 64  # stops that may wait for answers at once; reserved for stops
NO_ANSWER = "no confirmation that its stop is set"
NOT_SEEN = f"not seen to stand within {SEEN_WITHIN:g} s"

BusSessions = Callable[[], Mapping[str, ZenohSession]]
"""The joined control sessions, by edge."""


class StopTarget(msgspec.Struct, frozen=True):
    """The robots to stop, by identity (``edge/robot``); empty: every robot of every edge."""

    robots: tuple[str, ...] = ()

    def names_by_edge(self) -> dict[str, list[str]]:
        """Return the names of the robots by edge; ``*``: on any edge; empty names: all."""
        if not self.robots:
            return {"*": []}
        found: dict[str, list[str]] = {}
        for robot in self.robots:
            edge, _, name = robot.rpartition("/")
            found.setdefault(edge or "*", []).append(name)
        return found


class StopRecord:
    """Progress of one stop; ``began`` is monotonic seconds. ``shown`` is its form for pages."""

    def __init__(self, by: str, why: str, target: StopTarget, robots: Iterable[str], began: float) -> None:
        self.began = began
        self.open = True
        self.problems: list[str] = []
        self._by, self._why, self._target = by, why, target
        self._robots: dict[str, dict[str, Any]] = {}
        for robot in robots:
            self._robot(robot)

    def acknowledge(self, robot: str, now: float, transport: str) -> None:
        """Record that the stop of a robot is set; the first confirmation counts."""
        found = self._robot(robot)
        if found["acknowledged"] is None:
            found |= {"acknowledged": _ms(now - self.began), "way": transport, "outcome": "set"}

    def observe(self, robot: str, outcome: str, now: float) -> None:
        """Record the outcome of a robot's stop by its state."""
        found = self._robot(robot)
        found["outcome"] = outcome
        if outcome == DONE and found["standing"] is None:
            found["standing"] = _ms(now - self.began)

    def pending(self) -> list[str]:
        """Return the robots whose stop is set, but whose outcome is open."""
        return [
            robot
            for robot, found in self._robots.items()
            if found["acknowledged"] is not None and (found["outcome"] in OPEN or found["outcome"] == "set")
        ]

    def close(self) -> None:
        """End it: robots without an answer, or not seen to stand, get that outcome."""
        self.open = False
        for found in self._robots.values():
            if found["acknowledged"] is None:
                found["outcome"] = NO_ANSWER
            elif found["outcome"] in OPEN or found["outcome"] == "set":
                found["outcome"] = NOT_SEEN

    def shown(self) -> dict[str, Any]:
        """Return it for pages."""
        return {
            "by": self._by,
            "why": self._why,
            "everything": not self._target.robots,
            "open": self.open,
            "robots": {robot: dict(found) for robot, found in self._robots.items()},
            "problems": list(self.problems),
        }

    def _robot(self, robot: str) -> dict[str, Any]:
        """Return the entry of a robot."""
        new = {"acknowledged": None, "standing": None, "way": "", "outcome": "asked"}
        return self._robots.setdefault(robot, new)


class StopTracker:
    """Sends stops and follows them; ``directories`` are those with the supervisors' sockets."""

    def __init__(
        self, view: FleetView, bus_sessions: BusSessions, directories: Callable[[], list[Path]], clock: Clock
    ) -> None:
        self._view = view
        self._bus_sessions = bus_sessions
        self._directories = directories
        self._clock = clock
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="stop")
        self._tasks: set[asyncio.Task[None]] = set()

    def close(self) -> None:
        """End the threads without waiting for pending requests."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def request(self, target: StopTarget, by: str, why: str, request: str = "") -> dict[str, Any]:
        """Stop robots on all routes at once; return the result when each edge has answered or timed out.

        A known ``request`` is not sent again: it arrived on two routes. The robots are followed afterwards.
        """
        request = request or secrets.token_hex(8)
        known = self._view.get("stops", request)
        if known is not None:
            return {"request": request, **known}
        meant = target.robots or tuple(self._view.states)
        record = StopRecord(by, why, target, meant, self._clock.monotonic())
        self._view.update_stop(request, record.shown())
        parameters, joined = parameters_of(by, why, request), self._bus_sessions()
        # Joined edges first: the others may keep threads waiting for an answer.
        ordered = sorted(target.names_by_edge().items(), key=lambda asked: asked[0] not in joined)
        requested = [
            self._request_edge(record, bus_session, edge, names, parameters)
            for edge, names in ordered
            for bus_session in self._sessions_to(edge)
        ]
        supervised = self._request_supervisors(record, target, why, request)
        await asyncio.gather(*requested, supervised)
        self._view.update_stop(request, record.shown())
        task = asyncio.create_task(self._follow(record, request), name=f"stop:{request}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return {"request": request, **record.shown()}

    def _sessions_to(self, edge: str) -> list[ZenohSession]:
        """Return the sessions that reach an edge; all of them if it is not joined itself."""
        bus_sessions = self._bus_sessions()
        return [bus_sessions[edge]] if edge in bus_sessions else list(bus_sessions.values())

    async def _request_edge(
        self,
        record: StopRecord,
        bus_session: ZenohSession,
        edge: str,
        names: list[str],
        parameters: Mapping[str, str],
    ) -> None:
        """Send the stop to an edge (``*``: to all), and record each answer as it arrives."""
        loop, payload = asyncio.get_running_loop(), msgspec.json.encode(names)

        def acknowledge(key: str, stopped: list[str]) -> None:
            for name in stopped:
                record.acknowledge(id_of(key.split("/")[1], name), self._clock.monotonic(), "bus")

        def request() -> None:
            for key, data in query_stop(bus_session, edge, payload, parameters):
                stopped = decode_json(data, list[str])
                loop.call_soon_threadsafe(acknowledge, key, stopped)

        try:
            await loop.run_in_executor(self._threads, request)
        except Exception as error:  # the other routes continue
            log.exception("the stop on the bus failed")
            record.problems.append(f"edge {edge}: {error}")

    async def _request_supervisors(
        self, record: StopRecord, target: StopTarget, why: str, request: str
    ) -> None:
        """Send the stop to the supervisors: they stop the robots of an edge that hangs or is away."""
        names = tuple(robot.rpartition("/")[2] for robot in target.robots)
        loop = asyncio.get_running_loop()

        def send() -> list[tuple[str, str, bool]]:
            return [
                (answer.edge, name, answer.kept)
                for directory in self._directories()
                for answer in stop_all(directory, names, why=why, request=request)
                for name in answer.names
            ]

        try:
            for edge, name, kept in await loop.run_in_executor(self._threads, send):
                if not kept:
                    record.acknowledge(id_of(edge, name), self._clock.monotonic(), "supervisor")
                else:
                    record.problems.append(f"edge {edge} is away: {name} was halted, its stop is set later")
        except Exception as error:  # the other routes continue
            log.exception("the stop by the supervisors failed")
            record.problems.append(f"supervisors: {error}")

    async def _follow(self, record: StopRecord, request: str) -> None:
        """Poll the robots' states, taken after the stop, until all stand or the time is over."""
        end = self._clock.monotonic() + SEEN_WITHIN
        first: dict[str, float] = {}
        while (pending := record.pending()) and self._clock.monotonic() < end:
            states = await asyncio.gather(*(self._state(robot) for robot in pending))
            now = self._clock.monotonic()
            for robot, state in zip(pending, states, strict=True):
                if state is not None:
                    seen = stop_outcome(state, first.setdefault(robot, state.stamp))
                    record.observe(robot, seen, now)
                    self._view.update_state(state, now)
            self._view.update_stop(request, record.shown())
            await asyncio.sleep(POLL_INTERVAL)
        record.close()
        self._view.update_stop(request, record.shown())

    async def _state(self, robot: str) -> RobotState | None:
        """Query the present state of a robot; None without an answer."""
        edge, _, name = robot.rpartition("/")

        def request() -> RobotState | None:
            for bus_session in self._sessions_to(edge)[:1]:
                for _, data in bus_session.request(keys.state(edge, name), b"", timeout=ANSWER_WITHIN):
                    return decode_json(data, RobotState)
            return None

        try:
            return await asyncio.to_thread(request)
        except Exception:
            log.exception("the state of %s could not be asked", robot)
            return None


def _ms(seconds: float) -> int:
    """Return whole milliseconds, at least one."""
    return max(1, round(seconds * 1000))
