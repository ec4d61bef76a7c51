"""The files of an edge's configuration: the fleet file, its includes, drop-ins and named files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.serialization import load_der_private_key
from pydantic import BaseModel

from fleet.config.masking import MASK, Masking
from fleet.config.schema import Sections
from fleet.config.text import texts_in
from fleet.config.yaml import SECRETS, Document

LARGEST = 16 << 20  # bytes of one file of the configuration
_PRIVATE = b"PRIVATE KEY"
_LARGEST_KEY = 64 << 10  # bytes
_DER = b"\x30"  # the first byte of every DER key
_KEY_FIELDS, _PEOPLE_FIELD = ("key", "private_key"), "people"


class CollectedFiles(msgspec.Struct):
    """The files of the configuration, by their path below the folder of the fleet file.

    ``keys`` are private keys, and ``telling`` files with the value of a secret; only their names are here.
    """

    files: dict[str, bytes] = {}
    keys: list[str] = []
    telling: list[str] = []
    masked: list[str] = []
    left_out: list[str] = []


def collect(file: Path, document: Document, config: Sections, masking: Masking) -> CollectedFiles:
    """Collect the fleet file, its includes, its drop-ins, and the named files beside it."""
    found = CollectedFiles()
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
    people = {path.resolve() for path in _paths(config, (_PEOPLE_FIELD,))}
    keys = {path.resolve() for path in _paths(config, _KEY_FIELDS)}
    for path in dict.fromkeys((*plugins, *named)):
        if path.resolve() in people:
            found.left_out.append(f"{path}: it says who may log in here")
        else:
            _add(path, file.parent, found, masking, is_key=path.resolve() in keys)
    return found


def _paths(value: object, fields: tuple[str, ...]) -> Iterator[Path]:
    """Yield the paths in fields of these names."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            found = getattr(value, name)
            if isinstance(found, Path) and name in fields:
                yield found
            else:
                yield from _paths(found, fields)
    elif isinstance(value, list | tuple):
        for each in value:
            yield from _paths(each, fields)


def _is_private_key(content: bytes) -> bool:
    """Return True if a file is a private key, as PEM or DER, also if encrypted."""
    if _PRIVATE in content:
        return True
    if not content.startswith(_DER) or len(content) > _LARGEST_KEY:
        return False
    try:
        load_der_private_key(content, None)
    except TypeError:  # it is encrypted
        return True
    except (ValueError, UnsupportedAlgorithm):
        return False
    return True


def _add(path: Path, folder: Path, found: CollectedFiles, masking: Masking, *, is_key: bool) -> None:
    """Add a file named in fleet.yaml; for private keys and files with secrets only the name."""
    try:
        if not path.is_file():
            return
        inside = _inside(path, folder, found)
        if not inside or inside in found.files or path.name == SECRETS:
            return
        content = path.read_bytes() if path.stat().st_size <= LARGEST else None
    except OSError as error:
        found.left_out.append(f"{path}: {error.strerror}")
        return
    if content is None:
        found.left_out.append(f"{path}: it is larger than {LARGEST >> 20} MiB")
    elif is_key or _is_private_key(content):
        found.keys.append(inside)
    elif masking.finds(content):
        found.telling.append(inside)
    else:
        found.files[inside] = content


def _inside(path: Path, folder: Path, found: CollectedFiles) -> str:
    """Return a path relative to the folder of the fleet file; empty, and reported, if it is outside."""
    try:
        return path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        found.left_out.append(f"{path}: it is not beside the fleet file")
        return ""
