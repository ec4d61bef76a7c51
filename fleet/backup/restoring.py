"""Restores a backup on this computer: everything is checked first, and the state is replaced atomically.

A backup does not contain later events. An emergency stop may have been set after it, so every robot is
stopped after a restore, until a person releases it.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from fleet.backup.archive import CONFIG, STATE, BackupError, Manifest
from fleet.backup.state_files import NEWEST, PLAIN
from fleet.errors import StateError
from fleet.host.journal.execution_journal import ANY
from fleet.host.journal.journal_file import FORMATS as JOURNAL_FORMATS
from fleet.spool.state_folder import JOURNAL, SPOOL, FileLock

_DAY = "%Y-%m-%d %H:%M"


class Restored(msgspec.Struct, frozen=True):
    """Result of a restore: the state folder, the place of the previous one, and the configuration files."""

    state: Path
    before: Path | None
    config: tuple[Path, ...]


def check_contents(contents: Mapping[str, bytes]) -> None:
    """Refuse state files that this version cannot use; raises BackupError. Writes nothing."""
    for name, content in contents.items():
        folder, _, file = name.partition("/")
        if folder != STATE or file in PLAIN:
            continue
        if file not in NEWEST:
            raise BackupError(f"{name} is no file of an edge's state")
        _check_database(name, content, NEWEST[file])


def _check_database(name: str, content: bytes, newest: int) -> None:
    """Refuse a database that is damaged, or of a newer format."""
    database = sqlite3.connect(":memory:")
    try:
        database.deserialize(content)
        (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
        (found,) = database.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        verdict, found = str(error), 0
    finally:
        database.close()
    if verdict != "ok":
        raise BackupError(f"{name} in the backup is damaged: {verdict}; take another backup")
    if not 0 < found <= newest:
        raise BackupError(f"{name} has format {found}; this fleet reads 1 to {newest}: install a newer one")


def restore(
    manifest: Manifest,
    contents: Mapping[str, bytes],
    state: Path,
    config: Path | None,
    *,
    replace: bool,
    now: float,
) -> Restored:
    """Write the state and, with ``config``, the configuration; ``now`` is Unix seconds. Raises BackupError.

    Existing state or files are refused; with ``replace`` the previous state is renamed, and configuration
    files are overwritten. If the edge runs, nothing is touched.
    """
    check_contents(contents)
    files = _config_files(contents, config)
    if not replace:
        _refuse_existing(state, files)
    with _taken(state):
        try:
            fresh = _written(manifest, contents, state)
            before = _exchanged(fresh, state, files, now)
        except OSError as error:
            words = error.strerror or error
            raise BackupError(f"cannot restore to {state}: {words}; the state is as it was") from None
    return Restored(state, before, tuple(files))


def _exchanged(fresh: Path, state: Path, files: Mapping[Path, bytes], now: float) -> Path | None:
    """Move everything into place; return the new name of the previous state. Reverts itself on OSError."""
    before: Path | None = None
    try:
        _write_all(files)
        before = _aside(state, now) if state.exists() else None
        _into_place(fresh, state)
    except OSError:
        if before is not None and not state.exists():
            before.rename(state)
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    _confirm(state, before)
    return before


def _config_files(contents: Mapping[str, bytes], config: Path | None) -> dict[Path, bytes]:
    """Return the configuration files by their target paths."""
    if config is None:
        return {}
    start = f"{CONFIG}/"
    return {
        config / name.removeprefix(start): data for name, data in contents.items() if name.startswith(start)
    }


def _refuse_existing(state: Path, files: Mapping[Path, bytes]) -> None:
    """Refuse to replace existing files, except those with the same content."""
    if _has_state(state):
        raise BackupError(f"{state} has the state of an edge already; --replace renames it aside")
    for path, content in files.items():
        if path.exists() and path.read_bytes() != content:
            raise BackupError(f"{path} exists and differs; --replace overwrites it, or give another folder")


def _has_state(state: Path) -> bool:
    """Return True for a folder with state files."""
    return any((state / name).exists() for name in NEWEST)


@contextlib.contextmanager
def _taken(state: Path) -> Iterator[None]:
    """Hold the locks of an edge's state inside a ``with`` block; raises BackupError if an edge holds one."""
    locks = [FileLock(state / name) for name in (SPOOL, JOURNAL)] if state.is_dir() else []
    try:
        for lock in locks:
            lock.acquire()
        yield
    except StateError as error:
        raise BackupError(
            f"{error}; stop it first: fleet service status, or Ctrl-C in its terminal"
        ) from None
    finally:
        for lock in locks:
            lock.release()


def _written(manifest: Manifest, contents: Mapping[str, bytes], state: Path) -> Path:
    """Write the state to a new folder beside its target, and return that folder."""
    state.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{state.name}.restoring-", dir=state.parent))
    try:
        for name, content in contents.items():
            folder, _, file = name.partition("/")
            if folder == STATE:
                _write(fresh / file, content)
        _stop_everything(fresh / JOURNAL, manifest)
        if os.geteuid() == 0:
            _give(fresh, state.parent.stat())
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    return fresh


def _stop_everything(journal: Path, manifest: Manifest) -> None:
    """Set the emergency stop of every robot; set stops keep their cause, releases are removed."""
    made = time.strftime(_DAY, time.localtime(manifest.made))
    why = f"restored from a backup of {made}: a stop may have been set since"
    with contextlib.closing(sqlite3.connect(journal, isolation_level=None)) as database:
        if database.execute("PRAGMA user_version").fetchone()[0] == 0:  # a backup without a journal
            steps = "; ".join(JOURNAL_FORMATS)
            database.executescript(f"BEGIN; {steps}; PRAGMA user_version = {len(JOURNAL_FORMATS)}; COMMIT")
        database.execute("PRAGMA synchronous = FULL")
        database.executescript("BEGIN; DELETE FROM latch WHERE why = ''; COMMIT")
        database.execute("INSERT OR REPLACE INTO latch VALUES (?, ?)", (ANY, why))
    journal.chmod(0o600)


def _write_all(files: Mapping[Path, bytes]) -> None:
    """Write the configuration files: first beside their targets, so that a full disk changes none."""
    fresh = {path: path.with_name(f".{path.name}.new") for path in files}
    try:
        for path, content in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            _write(fresh[path], content)
        for path, written in fresh.items():
            written.replace(path)
    finally:
        for written in fresh.values():
            written.unlink(missing_ok=True)


def _write(path: Path, content: bytes) -> None:
    """Write a new file to disk, for this user only."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(descriptor)


def _give(folder: Path, like: os.stat_result) -> None:
    """Give a folder and its files to the owner of the parent folder: the user of the service."""
    for path in (folder, *folder.iterdir()):
        os.chown(path, like.st_uid, like.st_gid)


def _aside(state: Path, now: float) -> Path:
    """Rename the previous state, with its log and recordings."""
    before = state.with_name(f"{state.name}.before-{int(now)}")
    state.rename(before)
    return before


def _into_place(fresh: Path, state: Path) -> None:
    """Make the new folder the state folder."""
    fresh.rename(state)


def _confirm(state: Path, before: Path | None) -> None:
    """Wait until the rename is on disk; raises BackupError: by then the state is replaced."""
    try:
        descriptor = os.open(state.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        was = f"; the state before is {before}" if before else ""
        raise BackupError(
            f"{state} has the backup, but the disk did not confirm it: {error.strerror or error}{was}; "
            "check the disk, then restore again with --replace"
        ) from None
