"""Missions over the bus: find, start, follow, control."""

from __future__ import annotations

import os
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from fleet.client import mission_requests
from fleet.client.edges import Edges
from fleet.client.local_user import local_user
from fleet.errors import Refused, TimedOut, WireError
from fleet.missions.report import MissionStartRequest, MissionState, RunControlRequest, RunState, Started
from fleet.missions.results import RunFile
from fleet.missions.store import RunLogEntry

LOOK = 0.5  # s between polls of a run
SILENT = 10.0  # s without an answer of the edge, which may be restarting, before following it fails
PLAN_FILES = frozenset({".plan", ".json"})
_YAML = frozenset({".yaml", ".yml"})
MISSION_FILES = PLAN_FILES | _YAML


class MissionRun:
    """One run of a mission on an edge. ``roles``: its robots by role, if this program started it."""

    def __init__(self, edges: Edges, state: RunState | Started, edge: str, by: str) -> None:
        self.id = state.run
        self.edge = edge
        self.roles: Mapping[str, Sequence[str]] = state.roles if isinstance(state, Started) else {}
        self._edges = edges
        self._by = by

    def state(self) -> RunState | None:
        """Return its present state; None without an answer of its edge."""
        return next(iter(mission_requests.runs(self._edges, self.id)), None)

    def follow(self, every: float = LOOK) -> Iterator[RunState]:
        """Yield its state every ``every`` seconds; the last one has its outcome.

        Raises TimedOut if its edge is silent for 10 s: then the outcome is unknown.
        """
        heard = time.monotonic()
        while True:
            state = self.state()
            if state is not None:
                heard = time.monotonic()
                yield state
                if state.outcome:
                    return
            elif time.monotonic() - heard > SILENT:
                raise TimedOut(f"run {self.id}: the edge does not answer; the outcome is unknown")
            time.sleep(every)

    def wait(self) -> RunState:
        """Wait for its end and return its last state; raises TimedOut like ``follow``."""
        return deque(self.follow(), maxlen=1).pop()  # a run may last for days

    def pause(self) -> None:
        """Pause it: its robots hold; raises Refused."""
        self._control(RunControlRequest("pause"))

    def resume(self) -> None:
        """Continue it; raises Refused, also while it waits for an answer to a question."""
        self._control(RunControlRequest("resume"))

    def abort(self) -> None:
        """End it as defined by its mission (``on_abort``); raises Refused."""
        self._control(RunControlRequest("abort"))

    def answer(self, *, goes_on: bool) -> None:
        """Answer its present question; raises Refused."""
        state = self.state()
        question = state.question.id if state is not None and state.question is not None else 0
        self._control(RunControlRequest("answer", question, goes_on=goes_on))

    def log(self) -> list[RunLogEntry]:
        """Return its log, oldest line first; raises TimedOut."""
        return mission_requests.story(self._edges, self.edge, self.id)

    def results(self) -> list[RunFile]:
        """Return its results so far: files on the disk of its edge."""
        return mission_requests.results(self._edges, self.edge, self.id)

    def _control(self, requested: RunControlRequest) -> None:
        """Send a control request; raises Refused, TimedOut."""
        named = msgspec.structs.replace(requested, session_id=self._by)
        refusal = mission_requests.control(self._edges, self.edge, self.id, named).refusal
        if refusal:
            raise Refused(f"run {self.id}: {refusal}")


def start_mission(
    edges: Edges,
    what: str,
    *,
    inputs: Mapping[str, Any],
    robots: Mapping[str, Sequence[str]],
    filled: Callable[[Mapping[str, Sequence[str]]], None] = lambda _roles: None,
) -> MissionRun:
    """Start a mission of fleet.yaml, or of a mission or plan file, and return its run; raises Refused.

    ``robots`` assigns robots to roles; the edge fills the other roles. ``filled`` is called with all robots
    by role before any of them moves; it may raise to prevent the start.
    """
    by, run = local_user(), uuid.uuid4().hex[:8]
    name, sent = mission_named(what)
    chosen = {role: list(names) for role, names in robots.items()}
    request = MissionStartRequest(mission=sent, inputs=dict(inputs), robots=chosen, run=run, session_id=by)
    edge = edge_of(edges, name, chosen, sent)
    shown = _accepted(
        mission_requests.start(edges, edge, name, msgspec.structs.replace(request, only_fill=True))
    )
    filled(shown.roles)
    started = _accepted(
        mission_requests.start(edges, edge, name, msgspec.structs.replace(request, robots=shown.roles))
    )
    return MissionRun(edges, msgspec.structs.replace(started, roles=shown.roles), edge, by)


def known_mission(edges: Edges, name: str) -> MissionState:
    """Return a mission by its name; raises Refused."""
    found = mission_requests.missions(edges, name)
    if not found:
        known = ", ".join(each.name for each in mission_requests.missions(edges, "*")) or "none"
        raise Refused(f"there is no mission {name!r}", hint=f"there are: {known}")
    if len(found) > 1:
        raise Refused(
            f"several edges have a mission {name!r}", hint="name the edge by its file: -f fleet.yaml"
        )
    return found[0]


def find_run(edges: Edges, run: str, *, ended: bool = False) -> RunState:
    """Return a run by its id or a prefix of it; without one, the only or the newest run. Raises Refused."""
    found = [each for each in mission_requests.runs(edges, "*") if ended or not each.outcome]
    if run:
        found = [each for each in found if each.run.startswith(run)]
    elif ended:
        found = sorted(found, key=lambda each: each.started)[-1:]
    if len(found) == 1:
        return found[0]
    what = f"run {run!r}" if run else "run"
    if not found:
        raise Refused(f"there is no {what}" + ("" if ended else " under way"), hint="fleet mission ps --all")
    raise Refused(f"there are several: {', '.join(each.run for each in found)}", hint="name one")


def mission_named(what: str) -> tuple[str, dict[str, Any] | None]:
    """Return a mission's name, and its content if it is a file; raises Refused, ConfigError."""
    path = Path(what)
    if path.suffix not in MISSION_FILES:
        return what, None
    name = "".join(each if each.isalnum() else "-" for each in path.stem.lower()) or "plan"
    if path.suffix in _YAML:
        from fleet.config.missions import KnownNames, read_mission  # noqa: PLC0415 - pydantic is slow to import

        return name, read_mission(path, os.environ, KnownNames()).data
    return name, plan_mission(path)


def plan_mission(path: Path) -> dict[str, Any]:
    """Return the one-step mission in which an aircraft flies a plan file; raises Refused."""
    from fleet.missions.plan import mission_of_plan, plan_in  # noqa: PLC0415 - only for files

    try:
        return mission_of_plan(plan_in(path.read_bytes()), f"the plan {path.name}")
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}") from None
    except WireError as error:
        raise Refused(f"{path}: {error}") from None


def _accepted(started: Started) -> Started:
    """Return the answer to a start; raises Refused if it is a refusal."""
    if started.refusal:
        raise Refused(started.refusal, hint=started.hint)
    return started


def edge_of(edges: Edges, name: str, robots: Mapping[str, Sequence[str]], sent: dict[str, Any] | None) -> str:
    """Return the edge that is to run a mission; raises Refused."""
    if sent is None:
        return known_mission(edges, name).edge
    owners = {robot.edge for names in robots.values() for each in names for robot in edges.named(each)}
    owners = owners or {edge.edge for edge in edges.edges()}
    if len(owners) != 1:
        raise Refused(
            f"several edges could run it: {', '.join(sorted(owners))}", hint="-f fleet.yaml says which"
        )
    return owners.pop()
