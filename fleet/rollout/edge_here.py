"""Access of the agent to the edge on this computer, by the same requests as ``fleet apply``."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

import msgspec

from fleet.client.changes import request_changes
from fleet.client.edges import Edges
from fleet.config.load import Loaded, load
from fleet.config.yaml import SECRETS, read
from fleet.errors import FleetError, NotRunning
from fleet.model.change import Change, ChangeKind, ChangesRequest, Outcome
from fleet.rollout.bundle import FLEET_FILE, BundleError
from fleet.rollout.faults import PartFault, faults_of

RELOAD_WITHIN = 90.0  # s


class Code(msgspec.Struct, frozen=True):
    """Changes of a bundle outside its fleet file.

    ``adapters``: adapters with changed code. ``files``: changed files that the edge reads at its start only.
    """

    adapters: tuple[str, ...] = ()
    files: tuple[str, ...] = ()


class ApplyResult(msgspec.Struct, frozen=True):
    """Result of one attempt to apply a bundle.

    ``failed``: the failures. ``waits``: the parts that cannot be applied yet, with their reasons. Both are
    empty if everything was applied. ``lines``: one line for each change.
    """

    lines: tuple[str, ...] = ()
    failed: str = ""
    waits: str = ""


class Running(msgspec.Struct, frozen=True):
    """A running edge: its health, the time of its start (Unix s), and the faults of its parts."""

    health: str
    cause: str
    since: float
    faults: tuple[PartFault, ...] = ()


class EdgeHere(Protocol):
    """Operations of the agent on its edge; all of them block."""

    def check(self, folder: Path, before: Path | None) -> Code:
        """Check the files of a bundle and compare them with the previous ones; raises FleetError."""

    def apply(self, by: str) -> ApplyResult:
        """Have the edge apply its fleet file; raises FleetError if it refuses the whole file."""

    def reload(self, adapter: str) -> str:
        """Reload the changed code of an adapter; return why that has to wait, empty if it is done."""

    def running(self) -> Running | None:
        """Return the running edge, None if it does not run."""


class LocalEdge:
    """The edge of an installation; ``file`` is the path of its fleet file through the link ``current``."""

    def __init__(self, edge: str, file: Path) -> None:
        self._edge, self._file = edge, file

    def check(self, folder: Path, before: Path | None) -> Code:
        """Check the files of a bundle and compare them with the previous ones."""
        file = folder / FLEET_FILE
        loaded = load(file)
        if loaded.config.edge.id != self._edge:
            raise BundleError(f"its {FLEET_FILE} is for edge {loaded.config.edge.id}, not {self._edge}")
        if before is None:
            return Code()
        compared = {Path(name).resolve() for name in read(file, os.environ).lines}
        changed = [name for name in _changed(before, folder) if (folder / name).resolve() not in compared]
        return _code(folder, loaded, changed)

    def apply(self, by: str) -> ApplyResult:
        """Have the edge apply its fleet file."""
        requested = ChangesRequest("apply", by=by, file=str(self._file.resolve()))
        answer = request_changes(self._edge, str(self._file), requested)
        if answer is None:
            return ApplyResult(waits=f"edge {self._edge} does not run; it starts with this bundle")
        return summary(answer.changes)

    def reload(self, adapter: str) -> str:
        """Reload the changed code of an adapter in its workers."""
        try:
            with Edges.reach(str(self._file)) as edges:
                robots = [state for state in edges.states() if state.adapter == adapter]
                fixed = [robot.name for robot in robots if not (robot.drop_in and robot.worker)]
                if fixed:
                    return f"restart the edge: {', '.join(fixed)} runs the code of {adapter} in its process"
                for worker in sorted({str(robot.worker) for robot in robots}):
                    reply = edges.reload(self._edge, worker, adapter, within=RELOAD_WITHIN)
                    if reply is None or not reply.ok:
                        return f"worker {worker}: {reply.reason if reply else 'it does not answer'}"
        except NotRunning:
            return ""  # the next start of the edge loads it
        return ""

    def running(self) -> Running | None:
        """Return the running edge."""
        try:
            with Edges.reach(str(self._file)) as edges:
                found = next((state for state in edges.edges() if state.edge == self._edge), None)
                robots = edges.states() if found else []
        except FleetError:
            return None
        if found is None:
            return None
        return Running(found.health, found.cause, found.stamp - found.uptime, faults_of(found, robots))


def summary(changes: Iterable[Change]) -> ApplyResult:
    """Return the result of all changes together."""
    lines, failed, waits = [], [], []
    for change in changes:
        if change.kind is ChangeKind.UNTOUCHED:
            continue
        lines.append(f"{change.name}: {change.kind.value}: {change.outcome.value}")
        if change.outcome is Outcome.FAILED:
            failed.append(f"{change.name}: {change.why}")
        elif change.outcome is not Outcome.DONE:
            waits.append(f"{change.name}: {change.why}")
    return ApplyResult(tuple(lines), "; ".join(failed), "; ".join(waits))


def _changed(before: Path, after: Path) -> list[str]:
    """Return the names of the files that differ between two folders."""
    one, other = _contents(before), _contents(after)
    return sorted(name for name in {*one, *other} if one.get(name) != other.get(name))


def _contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by name, without the secrets, which belong to the edge."""
    files = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files if path.name != SECRETS}


def _code(folder: Path, loaded: Loaded, changed: list[str]) -> Code:
    """Sort changed files that are not part of the fleet file into code of adapters and other files."""
    places = [path.resolve() for path in loaded.config.plugins]

    def is_code(name: str) -> bool:
        return name.endswith(".py") and any((folder / name).resolve().is_relative_to(at) for at in places)

    code = [name for name in changed if is_code(name)]
    adapters = {plugin.name for _, plugin in loaded.robots if plugin.file is not None} if code else set()
    return Code(tuple(sorted(adapters)), tuple(name for name in changed if name not in code))
