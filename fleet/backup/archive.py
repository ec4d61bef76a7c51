"""The archive of a backup: a compressed tar file whose first member lists all others with their hashes.

An archive is untrusted input. Reading is strict: only regular files with the names of the manifest, each with
its size and hash, within limits; nothing is extracted to a path from the archive.
"""

from __future__ import annotations

import hashlib
import io
import os
import tarfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import msgspec

from fleet.errors import FleetError
from fleet.runtime.decoding import decode_json

FORMAT = 1
MANIFEST = "manifest.json"
STATE, CONFIG = "state", "config"
LARGEST = 4 << 30  # bytes of all files together
LARGEST_MANIFEST = 1 << 20
MOST = 10_000  # files


class BackupError(FleetError):
    """A backup cannot be made, or cannot be used."""


class FileEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One file: its size in bytes and its SHA-256."""

    size: int
    sha256: str


class Manifest(msgspec.Struct, frozen=True):
    """Contents of an archive. ``made`` is Unix seconds.

    ``secrets`` are the names in secrets.yaml, ``keys`` the private keys named in fleet.yaml, ``masked`` the
    configuration files with values replaced by ``****``: none of these values is in the archive.
    """

    format: int
    edge: str
    version: str
    made: float
    files: dict[str, FileEntry]
    config_file: str = ""
    secrets: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    masked: tuple[str, ...] = ()


def entry_of(content: bytes) -> FileEntry:
    """Return the entry of a file."""
    return FileEntry(len(content), hashlib.sha256(content).hexdigest())


def write_archive(path: Path, manifest: Manifest, contents: Mapping[str, bytes]) -> None:
    """Write an archive for this user only, atomically; never replaces a file.

    Raises BackupError.
    """
    fresh = path.with_name(f".{path.name}.part")
    try:
        if path.exists():
            raise BackupError(f"{path} exists already: give another name (-o)")
        descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        with io.FileIO(descriptor, "wb") as raw:
            with tarfile.open(fileobj=raw, mode="w:gz") as archive:
                _add(archive, MANIFEST, msgspec.json.format(msgspec.json.encode(manifest)), manifest.made)
                for name, content in contents.items():
                    _add(archive, name, content, manifest.made)
            os.fsync(descriptor)
        fresh.rename(path)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise BackupError(f"cannot write {path}: {error.strerror}") from None


def _add(archive: tarfile.TarFile, name: str, content: bytes, stamp: float) -> None:
    """Add one file."""
    info = tarfile.TarInfo(name)
    info.size, info.mode, info.mtime = len(content), 0o600, int(stamp)
    archive.addfile(info, io.BytesIO(content))


def read_archive(path: Path) -> tuple[Manifest, dict[str, bytes]]:
    """Return the contents of an archive, with every hash verified; raises BackupError."""
    try:
        with tarfile.open(path, mode="r:gz") as archive:
            manifest = _manifest(archive, path)
            contents = {name: _content(archive, name, entry) for name, entry in manifest.files.items()}
            listed = {member.name for member in archive.getmembers()} - {MANIFEST}
    except (tarfile.TarError, EOFError, OSError, KeyError, ValueError) as error:
        words = getattr(error, "strerror", None) or error
        raise BackupError(f"{path} is no complete backup: {words}; take another copy of it") from None
    if extra := listed - contents.keys():
        raise BackupError(f"{path}: {min(extra)} is not in its manifest: it is not as fleet backup made it")
    return manifest, contents


def _manifest(archive: tarfile.TarFile, path: Path) -> Manifest:
    """Return the manifest; raises BackupError for one that this version cannot use."""
    first = archive.next()
    if first is None or first.name != MANIFEST or not first.isreg() or first.size > LARGEST_MANIFEST:
        raise BackupError(f"{path} is no backup of fleet: it does not begin with {MANIFEST}")
    data = _bytes_of(archive, first)
    try:
        found = decode_json(data, Manifest)
    except msgspec.DecodeError as error:
        raise BackupError(f"{path}: its manifest cannot be read: {error}") from None
    if found.format > FORMAT:
        raise BackupError(
            f"{path} has format {found.format}, of a newer fleet ({found.version}); this one reads {FORMAT}"
        )
    if len(found.files) > MOST or sum(entry.size for entry in found.files.values()) > LARGEST:
        raise BackupError(f"{path} holds more than {MOST} files or {LARGEST >> 30} GiB")
    for name in found.files:
        _check_name(name, path)
    return found


def _check_name(name: str, path: Path) -> None:
    """Refuse a name outside of state and config."""
    parts = PurePosixPath(name).parts
    plain = len(parts) > 1 and parts[0] in (STATE, CONFIG) and not {"..", "."} & set(parts)
    if not plain or "\0" in name or "\\" in name or str(PurePosixPath(name)) != name:
        raise BackupError(f"{path}: {name!r} is no name of a file of a backup")


def _content(archive: tarfile.TarFile, name: str, entry: FileEntry) -> bytes:
    """Return a file that matches its entry; raises BackupError, or KeyError if it is missing."""
    member = archive.getmember(name)
    if not member.isreg() or member.size != entry.size:
        raise BackupError(f"{name} in the backup has not the size of its manifest: take another copy of it")
    content = _bytes_of(archive, member)
    if entry_of(content) != entry:
        raise BackupError(f"{name} in the backup is damaged (SHA-256 differs): take another copy of it")
    return content


def _bytes_of(archive: tarfile.TarFile, member: tarfile.TarInfo) -> bytes:
    """Return the content of a regular member."""
    file = archive.extractfile(member)
    return file.read(member.size) if file is not None else b""
