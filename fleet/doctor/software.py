"""Versions: this software, its extras for the links in use, the state on disk, and the other edges."""

from __future__ import annotations

import importlib.util
import sqlite3
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.doctor.finding import Finding, error, ok, warning
from fleet.model.state import EdgeState

VERSIONS, STATE, EDGES = "versions", "state", "edges"
_TRUSTED = 0.3  # s, the default of clock_skew
EXTRAS: Mapping[str, tuple[str, str]] = {
    "serial:": ("serialx", "serial"),
    "can:": ("can", "can"),
}
"""Prefixes of links, with the required module and the extra that installs it."""


def _is_installed(module: str) -> bool:
    """Return True if a module can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def check_extras(links: Iterable[str], is_installed: Callable[[str], bool] = _is_installed) -> list[Finding]:
    """Check that the modules required by the links are installed."""
    needed = {EXTRAS[start] for link in links for start in EXTRAS if link.startswith(start)}
    return [
        error(VERSIONS, f"links of this fleet need the extra {extra}", f"pip install 'zenoh-fleet[{extra}]'")
        for module, extra in sorted(needed)
        if not is_installed(module)
    ]


def check_state(folder: Path, newest: Mapping[str, int]) -> list[Finding]:
    """Check the state files: readable, and of no newer format; ``newest`` by name of the file."""
    return [_check_database(folder / name, most) for name, most in newest.items() if (folder / name).exists()]


def _check_database(file: Path, newest: int) -> Finding:
    """Check one state file, read-only."""
    try:
        # immutable: creates neither a lock nor a journal of SQLite beside a running edge's file
        database = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
        try:
            (found,) = database.execute("PRAGMA user_version").fetchone()
            (table,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
        finally:
            database.close()
    except sqlite3.Error as problem:
        return error(
            STATE,
            f"{file} cannot be read: {problem}",
            "fleet restore a backup, or move the file away and release the robots",
        )
    if found > newest:
        return error(
            STATE,
            f"{file} has format {found}; this fleet reads up to {newest}",
            "install the newer fleet again",
        )
    return ok(STATE, f"{file.name}: format {found}, {table} tables and indexes")


class AnsweredEdge(msgspec.Struct, frozen=True):
    """An edge that answered: its clock minus ours, and the uncertainty of that (s)."""

    state: EdgeState
    offset: float
    doubt: float


def check_edges(seen: Iterable[AnsweredEdge], problems: Iterable[str], version: str) -> list[Finding]:
    """Check the reachable edges: they answer, their clocks agree, their versions are ours."""
    findings = [error(EDGES, text, "fleet logs and fleet service status there") for text in problems]
    for edge in seen:
        name = edge.state.edge
        if abs(edge.offset) > _TRUSTED + edge.doubt:
            findings.append(
                error(
                    EDGES,
                    f"the clock of {name} differs by {edge.offset:+.1f} s",
                    "set both clocks by the network",
                )
            )
        elif edge.state.version != version:
            findings.append(
                warning(
                    EDGES,
                    f"{name} runs fleet {edge.state.version}, this is {version}",
                    "upgrade the older one",
                )
            )
        else:
            findings.append(ok(EDGES, f"{name} answers, version {version}, clock {edge.offset:+.2f} s"))
    return findings
