"""The files of an edge's configuration: the fleet file, what it includes, its drop-ins, and what it names."""

from __future__ import annotations

from pathlib import Path

import msgspec

from fleet.config.masking import MASK, Masking
from fleet.config.schema import Sections
from fleet.config.text import texts_in
from fleet.config.yaml import SECRETS, Document

LARGEST = 16 << 20  # bytes of one file of the configuration
_PRIVATE = b"PRIVATE KEY"


class Configuration(msgspec.Struct):
    """The files of the configuration, by their path below the folder of the fleet file."""

    files: dict[str, bytes] = {}
    keys: list[str] = []
    masked: list[str] = []
    left_out: list[str] = []


def collect(file: Path, document: Document, config: Sections, masking: Masking) -> Configuration:
    """Collect the fleet file, what it includes, its drop-ins, and the files beside it that it names."""
    found = Configuration()
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


def _add(path: Path, folder: Path, found: Configuration) -> None:
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


def _inside(path: Path, folder: Path, found: Configuration) -> str:
    """Return a path as seen from the folder of the fleet file; empty, and told, for one that is outside."""
    try:
        return path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        found.left_out.append(f"{path}: it is not beside the fleet file")
        return ""
