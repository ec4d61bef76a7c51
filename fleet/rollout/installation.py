"""Folder of an edge with bundles: one subfolder for each bundle, and a link to the active one.

    rollout.yaml          address of the store, trusted keys
    secrets.yaml          secrets of the edge
    versions/ADDRESS/     files of a bundle
    current               link to the active bundle; the edge runs with current/fleet.yaml
    rollout-state.json    record of the agent (``fleet.rollout.decision.Record``)

The link is replaced atomically, so an edge that starts at any moment reads one complete bundle.
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
from fleet.rollout.decision import AgentRecord
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import refuse_newer
from fleet.spool.state_folder import FileLock

CURRENT, VERSIONS, STATE = "current", "versions", "rollout-state.json"
FORMAT = 1
_PART = ".new-"


class Installation:
    """Folder of one edge; all methods block and raise StateError."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = FileLock(folder / STATE)

    def lock(self) -> None:
        """Lock the folder for this process; raises StateTaken if another process holds the lock."""
        self._lock.acquire()

    def release(self) -> None:
        """Unlock the folder."""
        self._lock.release()

    @property
    def current(self) -> str:
        """Address of the active bundle; empty if there is none."""
        try:
            return (self.folder / CURRENT).readlink().name
        except OSError:
            return ""

    def folder_of(self, bundle: str) -> Path:
        """Return the folder with the files of a bundle."""
        return self.folder / VERSIONS / bundle

    @property
    def file_in_use(self) -> Path:
        """Path of the fleet file through the link, which stays the same for every bundle."""
        return self.folder / CURRENT / FLEET_FILE

    def stage(self, bundle: Bundle, address: str) -> None:
        """Write the files of a bundle into its folder atomically."""
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
        """Point the link at a staged bundle."""
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

    def remove_unused(self) -> None:
        """Remove all bundles that are not in use."""
        folder, kept = self.folder / VERSIONS, self._in_use()
        for path in folder.iterdir() if folder.is_dir() else ():
            if path.name not in kept:
                shutil.rmtree(path, ignore_errors=True)

    def _in_use(self) -> frozenset[str]:
        """Return the bundles that are kept: the active one, and the last one that was applied completely.

        While a new bundle is pending, the edge may still run with the previous one and may roll back to it.
        """
        return frozenset({self.current, self.record().running})

    def record(self) -> AgentRecord:
        """Read the record of the agent; an empty record if there is none."""
        path = self.folder / STATE
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return AgentRecord()
        except OSError as error:
            raise StateError(f"cannot read {path}: {error.strerror}") from None
        try:
            found = decode_json(data, AgentRecord)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise StateError(
                f"{path} cannot be read: {error}; without it an older bundle could pass: restore it"
            ) from None
        refuse_newer(found.format, FORMAT)
        return found

    def save_record(self, record: AgentRecord) -> None:
        """Write the record of the agent atomically."""
        path = self.folder / STATE
        fresh = path.with_suffix(".new")
        try:
            _write(fresh, msgspec.json.encode(record))
            fresh.replace(path)
            _sync(self.folder)
        except OSError as error:
            raise StateError(f"cannot write {path}: {error.strerror or error}") from None


def _write(path: Path, content: bytes) -> None:
    """Write a file that only this user may read, and synchronise it to disk."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(descriptor)


def _sync(folder: Path) -> None:
    """Synchronise the entries of a folder to disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
