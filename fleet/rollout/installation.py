"""The folder of an edge that takes bundles: each in a folder of its own, and a link to the one in use.

    rollout.yaml          where the store is, whose bundles are taken
    secrets.yaml          the edge's own secrets
    versions/ADDRESS/     the files of a bundle
    current               link to the folder in use; the edge runs with current/fleet.yaml
    rollout-state.json    how far the edge is

The link is exchanged in one step, so an edge that is started at any moment reads one bundle or the other.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import msgspec

from fleet.config.yaml import SECRETS
from fleet.errors import StateError
from fleet.rollout.bundle import FLEET_FILE, Bundle
from fleet.rollout.decision import Record
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import refuse_newer
from fleet.spool.state_folder import FileLock

CURRENT, VERSIONS, STATE = "current", "versions", "rollout-state.json"
FORMAT = 1
_PART = ".new-"


class Installation:
    """The folder of one edge; everything blocks, and raises StateError."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = FileLock(folder / STATE)

    def take(self) -> None:
        """Take the folder for this process; raises StateTaken when another one has it."""
        self._lock.take()

    def let_go(self) -> None:
        """Let go of the folder."""
        self._lock.release()

    @property
    def current(self) -> str:
        """The address of the bundle in use; empty without one."""
        try:
            return (self.folder / CURRENT).readlink().name
        except OSError:
            return ""

    def folder_of(self, bundle: str) -> Path:
        """Return where the files of a bundle are."""
        return self.folder / VERSIONS / bundle

    @property
    def file_in_use(self) -> Path:
        """The fleet file in use, by the path that stays the same."""
        return self.folder / CURRENT / FLEET_FILE

    def stage(self, bundle: Bundle, address: str) -> None:
        """Write the files of a bundle into its folder, whole or not at all."""
        place = self.folder_of(address)
        if address in self._in_use() and place.is_dir():
            return
        try:
            place.parent.mkdir(mode=0o700, exist_ok=True)
            shutil.rmtree(place, ignore_errors=True)
            fresh = Path(tempfile.mkdtemp(prefix=_PART, dir=place.parent))
            for name, content in bundle.files.items():
                _write(fresh / name, content)
            (fresh / SECRETS).symlink_to(Path("..", "..", SECRETS))
            _sync(fresh)
            fresh.rename(place)
            _sync(place.parent)
        except OSError as error:
            raise StateError(f"cannot write the bundle to {place}: {error.strerror or error}") from None

    def activate(self, address: str) -> None:
        """Let the link lead to a bundle that was staged."""
        fresh = self.folder / f".{CURRENT}.new"
        try:
            fresh.unlink(missing_ok=True)
            fresh.symlink_to(Path(VERSIONS, address))
            fresh.replace(self.folder / CURRENT)
            _sync(self.folder)
        except OSError as error:
            raise StateError(
                f"cannot put bundle {address[:12]} in place: {error.strerror or error}"
            ) from None

    def tidy(self) -> None:
        """Remove the bundles that nobody goes back to."""
        folder, kept = self.folder / VERSIONS, self._in_use()
        for path in folder.iterdir() if folder.is_dir() else ():
            if path.name not in kept:
                shutil.rmtree(path, ignore_errors=True)

    def _in_use(self) -> frozenset[str]:
        """Return the bundles that are never removed: in place, and the last that was taken as a whole.

        While another one waits, the edge may run with that, and goes back to it.
        """
        return frozenset({self.current, self.record().running})

    def record(self) -> Record:
        """Return how far the edge is."""
        path = self.folder / STATE
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return Record()
        except OSError as error:
            raise StateError(f"cannot read {path}: {error.strerror}") from None
        try:
            found = decode_json(data, Record)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise StateError(
                f"{path} cannot be read: {error}; without it an older bundle could pass: restore it"
            ) from None
        refuse_newer(found.format, FORMAT)
        return found

    def keep(self, record: Record) -> None:
        """Write how far the edge is, whole or not at all."""
        path = self.folder / STATE
        fresh = path.with_suffix(".new")
        try:
            _write(fresh, msgspec.json.encode(record))
            fresh.replace(path)
            _sync(self.folder)
        except OSError as error:
            raise StateError(f"cannot write {path}: {error.strerror or error}") from None


def _write(path: Path, content: bytes) -> None:
    """Write a file to the disk, for this user alone."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(descriptor)


def _sync(folder: Path) -> None:
    """Wait until the disk has the names in a folder."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
