"""Makes a backup: copies the state of an edge, which may run meanwhile, and its configuration."""

from __future__ import annotations

import contextlib
import sqlite3
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from fleet.backup.archive import CONFIG, FORMAT, STATE, BackupError, Manifest, entry_of
from fleet.backup.state_files import NEWEST, PLAIN
from fleet.config.masking import MASK, Masking, kept_secrets, secrets_in
from fleet.config.schema import Sections
from fleet.config.text import texts_in
from fleet.config.yaml import SECRETS, Document, read, secret_names
from fleet.version import __version__

LARGEST = 16 << 20  # bytes of one file of the configuration
_PRIVATE = b"PRIVATE KEY"
BUSY = 5.0  # s to wait for the edge's own write


class Packed(msgspec.Struct, frozen=True):
    """A backup before it is written; ``left_out`` says in words what is not in it."""

    manifest: Manifest
    contents: Mapping[str, bytes]
    left_out: tuple[str, ...]


class _Configuration(msgspec.Struct):
    """The files of the configuration, by their path below the folder of the fleet file."""

    files: dict[str, bytes] = {}
    keys: list[str] = []
    masked: list[str] = []
    left_out: list[str] = []


def pack(file: Path, config: Sections, state: Path, environ: Mapping[str, str], now: float) -> Packed:
    """Return the backup of an edge; ``now`` is Unix seconds. Raises BackupError.

    An edge without state yet has none in its backup.
    """
    contents = {f"{STATE}/{name}": content for name, content in _state(state)}
    found = _configuration(file, read(file, environ), config, environ)
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
    return Packed(manifest, contents, tuple(found.left_out))


def _state(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the state files that exist."""
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


def _configuration(
    file: Path, document: Document, config: Sections, environ: Mapping[str, str]
) -> _Configuration:
    """Collect the fleet file, what it includes, its drop-ins, and the files beside it that it names."""
    found = _Configuration()
    masking = Masking(secrets_in(document, kept_secrets(file.parent / SECRETS), environ))
    for name, lines in document.lines.items():
        text = masking.config(lines)
        if inside := _inside(Path(name), file.parent, found):
            found.files[inside] = text.encode()
            if MASK in text and MASK not in "\n".join(lines):
                found.masked.append(inside)
    plugins = [path for folder in config.plugins for path in sorted(folder.rglob("*.py"))]
    named = [
        file.parent / text for text in texts_in(document.data) if 0 < len(text) < 1024 and "\0" not in text
    ]
    for path in (*plugins, *named):
        _add(path, file.parent, found)
    return found


def _add(path: Path, folder: Path, found: _Configuration) -> None:
    """Add a file that fleet.yaml names; of a private key and of secrets.yaml only the name."""
    try:
        if not path.is_file():
            return
        inside = _inside(path, folder, found)
        if not inside or inside in found.files or path.name == SECRETS:
            return
        content = path.read_bytes() if path.stat().st_size <= LARGEST else b""
    except OSError as error:
        found.left_out.append(f"{path}: {error.strerror}")
        return
    if _PRIVATE in content:
        found.keys.append(inside)
    elif content:
        found.files[inside] = content
    else:
        found.left_out.append(f"{path}: it is empty or larger than {LARGEST >> 20} MiB")


def _inside(path: Path, folder: Path, found: _Configuration) -> str:
    """Return a path as seen from the folder of the fleet file; empty, and told, for one that is outside."""
    try:
        return path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        found.left_out.append(f"{path}: it is not beside the fleet file")
        return ""
