"""``fleet support``: one archive with everything for support, without secrets."""

from __future__ import annotations

import importlib.metadata
import io
import json
import os
import platform
import sys
import tarfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import click
import msgspec

from fleet.cli.history import for_programs
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.ps import for_programs as state_for_programs
from fleet.client.edges import Edges
from fleet.config.load import load
from fleet.config.masking import Masking, kept_secrets, secrets_in
from fleet.config.problems import InvalidConfig
from fleet.config.yaml import SECRETS, Document, read
from fleet.errors import FleetError
from fleet.history.event_filter import MOST, EventFilter
from fleet.history.reader import read as read_history
from fleet.host.logs.folders import log_folder
from fleet.spool.state_folder import state_folder
from fleet.version import __version__

LOGS = 32 << 20  # bytes of logs at most, the newest
_SECONDS = "%Y%m%d-%H%M%S"


@click.command()
@click.option("-f", "--file", default="fleet.yaml", show_default=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), help="The archive to write.")
@with_output
def support(out: Output, file: Path, output: Path | None) -> ExitCode:
    """Pack configuration, logs, history, state and versions into one archive, for support.

    Passwords, tokens and all of secrets.yaml are removed, wherever they occur. Check it before you send it:
    it contains names, places and addresses of the site.
    """
    document, masking = _opened(file, os.environ)
    edge, folder = _edge_of(document, os.environ)
    path = output or Path(f"fleet-support-{edge}-{time.strftime(_SECONDS)}.tar.gz")
    parts: dict[str, Callable[[], str]] = {
        "versions.json": _versions,
        "problems.txt": lambda: _problems(file),
        "state.json": lambda: _state(file),
        "history.jsonl": lambda: _history(folder),
    }
    failed: dict[str, str] = {}
    with _created(path) as raw, tarfile.open(fileobj=raw, mode="w:gz") as archive:
        for name, lines in document.lines.items():
            _add(archive, f"config/{Path(name).name}", masking.config(lines))
        for name, made in parts.items():
            try:
                _add(archive, name, masking.text(made()))
            except (FleetError, OSError) as error:
                failed[name] = masking.text(str(error))
        for name, content in _logs(log_folder(folder)):
            _add(archive, f"log/{name}", masking.text(content))
        _add(archive, "left_out.json", json.dumps(failed, indent=2))
    out.data({"file": str(path), "left_out": failed})
    out.say(str(path))
    for name, why in failed.items():
        out.note(f"{name} is left out: {why}")
    return ExitCode.OK


def _opened(file: Path, environ: Mapping[str, str]) -> tuple[Document, Masking]:
    """Return the content of a fleet file, which may be invalid, and the masking of its secrets."""
    document = read(file, environ)
    return document, Masking(secrets_in(document, kept_secrets(file.parent / SECRETS), environ))


def _edge_of(document: Document, environ: Mapping[str, str]) -> tuple[str, Path]:
    """Return the edge and its state folder, as far as the file names them."""
    edge = _mapping(_mapping(document.data).get("edge"))
    name = str(edge.get("id") or "unknown").replace("/", "_")
    given = _mapping(edge.get("spool")).get("path")
    return name, state_folder(name, Path(given) if isinstance(given, str) else None, environ)


def _mapping(value: object) -> Mapping[str, object]:
    """Return a mapping of the file; empty for other values."""
    return value if isinstance(value, dict) else {}


def _versions() -> str:
    """Return the versions of this installation."""
    packages = sorted({f"{each.name}=={each.version}" for each in importlib.metadata.distributions()})
    return json.dumps(
        {
            "fleet": __version__,
            "python": sys.version,
            "platform": platform.platform(),
            "machine": platform.machine(),
            "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
            "packages": packages,
        },
        indent=2,
    )


def _problems(file: Path) -> str:
    """Return the errors and warnings of the configuration."""
    try:
        loaded = load(file, partial=True)
    except InvalidConfig as error:
        return str(error)
    return "\n".join(str(each) for each in (*loaded.problems, *loaded.warnings))


def _state(file: Path) -> str:
    """Return the state of the running edge and its robots."""
    with Edges.reach(str(file)) as edges:
        found = {
            "edges": [state_for_programs(each) for each in edges.edges()],
            "robots": [state_for_programs(each) for each in edges.states()],
        }
    return msgspec.json.encode(found).decode()


def _history(folder: Path) -> str:
    """Return the newest events, one per line."""
    records = read_history(folder, EventFilter(most=MOST))
    return "".join(f"{msgspec.json.encode(for_programs(each)).decode()}\n" for each in records)


def _logs(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the names and contents of the logs, newest first, as many as fit."""
    room = LOGS
    paths = sorted(folder.glob("*.jsonl*"), key=lambda path: path.stat().st_mtime, reverse=True)
    for path in paths:
        content = path.read_bytes()
        if len(content) > room:
            return
        room -= len(content)
        yield path.name, content.decode(errors="backslashreplace")


def _created(path: Path) -> io.BufferedWriter:
    """Create the archive, for this user only; raises OSError, also if it exists."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    return io.BufferedWriter(io.FileIO(descriptor, "wb"))


def _add(archive: tarfile.TarFile, name: str, content: str) -> None:
    """Add one file."""
    data = content.encode(errors="backslashreplace")
    info = tarfile.TarInfo(f"fleet-support/{name}")
    info.size, info.mode, info.mtime = len(data), 0o600, int(time.time())
    archive.addfile(info, io.BytesIO(data))
