"""The way from a command to the edges that run: over their control lanes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from typing import Self

import msgspec

from fleet.bus import keys
from fleet.bus.lane import Lane
from fleet.bus.session import join_control
from fleet.bus.settings import BusSettings, running_edges, runtime_dir
from fleet.config.text import nearest
from fleet.errors import BusError, FleetError
from fleet.model.command import Reply
from fleet.model.state import EdgeState, RobotState

ANSWER_WITHIN = 2.0  # s for what an edge knows without asking a robot


class NotRunning(FleetError):
    """No edge answers."""


class UnknownRobot(FleetError):
    """No running edge has a robot, or a group, of this name."""


class Edges:
    """The edges that can be reached: all that run on this machine, or those behind ``connect`` of a file."""

    def __init__(self, lanes: list[Lane]) -> None:
        self._lanes = lanes

    @classmethod
    def reach(cls, file: str | None) -> Self:
        """Join them; raises NotRunning when there is none."""
        settings = (
            [BusSettings(edge) for edge in running_edges(runtime_dir())] if file is None else [_of(file)]
        )
        lanes = []
        for each in settings:
            with contextlib.suppress(BusError):  # a socket that a killed edge left behind
                lanes.append(join_control(each, runtime_dir()))
        if not lanes:
            which = f"the edge of {file}" if file else "no edge"
            raise NotRunning(
                f"{which} is running here; start one with: fleet run fleet.yaml (or: fleet demo)"
            )
        return cls(lanes)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for lane in self._lanes:
            lane.close()

    def states(self) -> list[RobotState]:
        """Return the robots' states, by name."""
        found = [msgspec.json.decode(data, type=RobotState) for data in self._asked(keys.state("*", "*"))]
        return sorted(found, key=lambda state: (state.edge, state.name))

    def edges(self) -> list[EdgeState]:
        """Return the edges' own states."""
        found = [msgspec.json.decode(data, type=EdgeState) for data in self._asked(keys.health("*"))]
        if not found:
            raise NotRunning("no edge answers; start one with: fleet run fleet.yaml (or: fleet demo)")
        return found

    def named(self, name: str) -> list[RobotState]:
        """Return the robot of this name, or the robots of this group; raises UnknownRobot."""
        states = self.states()
        groups: dict[str, list[str]] = {}
        for edge in self.edges():
            groups |= edge.groups
        wanted = groups.get(name, [name])
        found = [state for state in states if state.name in wanted]
        if not found:
            known = [state.name for state in states]
            near = nearest(name, [*known, *groups])
            raise UnknownRobot(
                f"there is no robot {name!r}; {near or 'there are: ' + (', '.join(known) or 'none')}"
            )
        return found

    def command(
        self, robot: RobotState, payload: bytes, *, kind: str, wait: bool, timeout: float
    ) -> Iterator[Reply]:
        """Ask a robot; yields the receipt and, when waited for, the end."""
        parameters: Mapping[str, str] = {"kind": kind, "wait": "1" if wait else "0"}
        key = keys.command(robot.edge, robot.name)
        for lane in self._lanes:
            for _, data in lane.ask(key, payload, timeout=timeout, parameters=parameters):
                yield msgspec.json.decode(data, type=Reply)

    def stop(self, names: list[str]) -> list[str]:
        """Emergency-stop robots on every edge (no name: all); returns who was stopped."""
        payload = msgspec.json.encode(names)
        stopped: list[str] = []
        for lane in self._lanes:
            for _, data in lane.ask(keys.stop("*"), payload, timeout=ANSWER_WITHIN, urgent=True):
                stopped += msgspec.json.decode(data, type=list[str])
        return sorted(set(stopped))

    def _asked(self, key: str) -> Iterator[bytes]:
        """Yield what everyone answers on a key."""
        for lane in self._lanes:
            for _, data in lane.ask(key, b"", timeout=ANSWER_WITHIN):
                yield data


def _of(file: str) -> BusSettings:
    """Return how to reach the edge of a fleet file."""
    from fleet.config.load import load  # noqa: PLC0415 - pydantic is not needed without a file
    from fleet.host.settings import bus_settings  # noqa: PLC0415

    return bus_settings(load(file, os.environ, partial=True).config)
