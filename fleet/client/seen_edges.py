"""List of the edges seen on a bus, on this user's disk; an edge that is gone stays until it is removed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.bus.settings import client_dirs
from fleet.errors import StateError, StateNewer
from fleet.health.rollup import SeenEdge
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of, refuse_newer
from fleet.spool.state_folder import create_folder, locked, state_folder

SeenEdgesById = dict[str, SeenEdge]

FILE = "seen-edges.json"
FORMAT = 1
LOCK_WITHIN = 5.0  # s; other views hold the lock only for a moment


class _SeenFile(msgspec.Struct, frozen=True):
    """Content of the file: edges by bus."""

    format: int
    buses: dict[str, SeenEdgesById]


class SeenEdges:
    """The list of one bus: that of a fleet file, or of the edges of this computer."""

    def __init__(self, file: str | None, environ: Mapping[str, str] = os.environ) -> None:
        self._path = state_folder("edge", environ=environ).parent / FILE
        self._bus = str(Path(file).resolve()) if file else str(client_dirs(environ)[0])

    def read(self) -> SeenEdgesById:
        """Return the edges as last written; raises StateError for an unreadable file."""
        return self._buses().get(self._bus, {})

    def save(self, edges: Iterable[SeenEdge]) -> None:
        """Write the newest views of edges; other edges are kept. Raises StateError."""
        found = {edge.edge: edge for edge in edges}
        self._change(lambda known: known | found)

    def forget(self, edge: str) -> bool:
        """Remove an edge; return False if it was not in the list. Raises StateError."""
        known = edge in self.read()
        self._change(lambda edges: {name: each for name, each in edges.items() if name != edge})
        return known

    def _change(self, change: Callable[[SeenEdgesById], SeenEdgesById]) -> None:
        """Rewrite the file with a change to the list of this bus."""
        create_folder(self._path.parent)
        with locked(self._path, within=LOCK_WITHIN):
            buses = self._buses()
            buses = {**buses, self._bus: change(buses.get(self._bus, {}))}
            new = self._path.with_suffix(".new")
            try:
                new.write_bytes(msgspec.json.encode(_SeenFile(FORMAT, buses)))
                new.replace(self._path)
            except OSError as error:
                raise StateError(f"cannot write {self._path}: {error.strerror}") from None

    def _buses(self) -> dict[str, SeenEdgesById]:
        """Return the content of the file."""
        try:
            data = self._path.read_bytes()
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise StateError(f"cannot read {self._path}: {error.strerror}") from None
        try:
            refuse_newer(format_of(data), FORMAT)
            return decode_json(data, _SeenFile).buses
        except StateNewer as error:
            raise StateError(f"{self._path}: {error}") from None
        except msgspec.DecodeError as error:
            raise StateError(
                f"{self._path} cannot be read ({error}); remove it, and edges that are gone "
                "are no longer known"
            ) from None
