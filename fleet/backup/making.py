"""Creation of a backup: copies the configuration and the state of an edge, which may be running."""

from __future__ import annotations

import contextlib
import sqlite3
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from fleet.backup.archive import CONFIG, FORMAT, STATE, BackupError, Manifest, entry_of
from fleet.backup.configuration import collect
from fleet.backup.state_files import NEWEST, PLAIN
from fleet.config.masking import Masking, kept_secrets, secrets_in
from fleet.config.schema import Sections
from fleet.config.yaml import SECRETS, read, secret_names
from fleet.version import __version__

BUSY = 5.0  # s to wait for a write of the edge


class Packed(msgspec.Struct, frozen=True):
    """A backup before it is written; ``left_out`` describes the missing parts."""

    manifest: Manifest
    contents: Mapping[str, bytes]
    left_out: tuple[str, ...]


def pack(file: Path, config: Sections, state: Path, environ: Mapping[str, str], now: float) -> Packed:
    """Return the backup of an edge; ``now`` is Unix seconds. Raises BackupError.

    The backup of an edge that has never run has no state.
    """
    contents = {f"{STATE}/{name}": content for name, content in _state(state)}
    document = read(file, environ)
    masking = Masking(secrets_in(document, kept_secrets(file.parent / SECRETS), environ))
    found = collect(file, document, config, masking)
    contents |= {f"{CONFIG}/{name}": content for name, content in found.files.items()}
    manifest = Manifest(
        FORMAT,
        config.edge.id,
        __version__,
        now,
        {name: entry_of(content) for name, content in contents.items()},
        config_file=file.name,
        secrets=tuple(secret_names(file.parent / SECRETS)),
        keys=tuple(found.keys),
        masked=tuple(found.masked),
    )
    telling = (f"{name}: the value of a secret stands in it" for name in found.telling)
    return Packed(manifest, contents, (*found.left_out, *telling))


def _state(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the existing state files."""
    for name in NEWEST:
        if (folder / name).exists():
            yield name, _copied(folder / name)
    for name in PLAIN:
        with contextlib.suppress(FileNotFoundError):
            yield name, (folder / name).read_bytes()


def _copied(path: Path) -> bytes:
    """Return a consistent copy of a database that may be in use; raises BackupError."""
    try:
        with tempfile.TemporaryDirectory() as place:
            copy = Path(place, path.name)
            source = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=BUSY)
            target = sqlite3.connect(copy)
            try:
                source.backup(target)
                target.execute("PRAGMA journal_mode = DELETE")
            finally:
                source.close()
                target.close()
            return copy.read_bytes()
    except (sqlite3.Error, OSError) as error:
        raise BackupError(f"{path} cannot be copied: {error}; run it as the edge's user or as root") from None
