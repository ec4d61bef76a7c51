"""The running fleet for Python programs; sends the same messages as the command line."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import msgspec

from fleet.client.edges import Edges
from fleet.client.local_user import local_user, stamped
from fleet.client.missions import MissionRun, find_run, start_mission
from fleet.errors import CommandError, Refused, TimedOut
from fleet.model.command import Reply
from fleet.model.state import RobotState
from fleet.wire.goals import GotoTarget, goals, target_of

RECEIPT_WITHIN = 15.0  # s
DONE_WITHIN = 120.0  # s


class Fleet:
    """The edges that run on this computer, or the edge of a fleet file; a context manager.

    Every method waits for its answer and raises NotRunning if no edge answers. The name of a group stands for
    all of its robots.
    """

    def __init__(self, file: str | Path | None = None) -> None:
        self._opened = contextlib.ExitStack()
        self._edges = self._opened.enter_context(Edges.reach(None if file is None else str(file)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the bus; runs that were started continue."""
        self._opened.close()

    def robots(self) -> list[RobotState]:
        """Return the present state of every robot."""
        return self._edges.states()

    def start(
        self, mission: str, *, robots: Mapping[str, Sequence[str]] | None = None, **inputs: Any
    ) -> MissionRun:
        """Start a mission of fleet.yaml or of a file (.yaml, .plan); raises Refused with the reason.

        ``robots`` assigns robots to roles; the edge fills the other roles.
        """
        return start_mission(self._edges, mission, inputs=inputs, robots=robots or {})

    def run(self, run: str = "") -> MissionRun:
        """Return a run by its id; without an id, the only run in progress. Raises Refused."""
        state = find_run(self._edges, run, ended=bool(run))
        return MissionRun(self._edges, state, state.edge, local_user())

    def send(
        self, robot: str, command: str, *, wait: bool = True, within: float = DONE_WITHIN, **data: Any
    ) -> dict[str, Reply]:
        """Send a command to a robot or group; return the last answer of each robot, by name.

        With ``wait``, wait until it is done, at most ``within`` seconds; otherwise until it is accepted.
        Raises Refused if a robot refuses it or fails, TimedOut without an answer in time.
        """
        robots = self._edges.named(robot)
        message: dict[str, object] = {"command": command, "data": data}
        return self._request(robots, "command", [message] * len(robots), wait=wait, within=within)

    def goto(
        self,
        robot: str,
        place: str | Sequence[float],
        *,
        speed: float | None = None,
        spacing: float | None = None,
        wait: bool = True,
        within: float = DONE_WITHIN,
    ) -> dict[str, Reply]:
        """Send a robot to a place of fleet.yaml, or to x, y and optionally z in metres in the site's frame.

        ``spacing`` (m) spreads the robots of a group around it; ``speed`` (m/s) limits all. See ``send`` for
        ``wait``, ``within`` and the errors.
        """
        robots = self._edges.named(robot)
        if isinstance(place, str):
            aim = target_of(self._edges.place(place, robots))
        else:
            x, y, *z = place
            aim = GotoTarget(x, y, z[0] if z else None, "site")
        aim = msgspec.structs.replace(aim, speed=speed, spacing=spacing)
        messages = goals(aim, robots)
        return self._request(robots, "navigate", messages, wait=wait, within=within)

    def stop(self, robot: str) -> dict[str, Reply]:
        """Stop a robot, which then holds its position and leaves its mission run."""
        return self.send(robot, "stop")

    def emergency_stop(self, robot: str) -> dict[str, Reply]:
        """Set the emergency stop of a robot, which a person must release (``fleet release``)."""
        return self.send(robot, "emergency_stop")

    def _request(
        self,
        robots: Sequence[RobotState],
        kind: str,
        messages: Iterable[dict[str, object]],
        *,
        wait: bool,
        within: float,
    ) -> dict[str, Reply]:
        """Send each robot its message concurrently; return their last answers. Raises the first error."""
        timeout = within if wait else min(within, RECEIPT_WITHIN)
        requested = [
            (robot, self._edges.command(robot, stamped(one), kind=kind, wait=wait, timeout=timeout))
            for robot, one in zip(robots, messages, strict=True)
        ]
        last: dict[str, Reply] = {}
        problems: list[CommandError] = []
        for robot, replies in requested:
            *_, reply = (None, *replies)
            if reply is None or (wait and reply.ok and reply.done is None):
                problems.append(
                    TimedOut(f"{robot.name}: no {'end' if reply else 'answer'} within {timeout:g} s")
                )
            elif not reply.ok or reply.done is False:
                problems.append(Refused(f"{robot.name}: {reply.reason}", hint=reply.hint))
            else:
                last[robot.name] = reply
        if problems:
            raise problems[0]
        return last
