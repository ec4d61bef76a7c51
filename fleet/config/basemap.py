"""Check of a PMTiles archive's header: whether the console can show it; pure.

PMTiles specification, version 3: "PMTiles" and the version in bytes 0 to 7, the tile type in byte 99.
"""

from __future__ import annotations

from pathlib import Path

HEAD = 127
"""Bytes of the header of an archive."""
MEDIA_TYPES = {2: "image/png", 3: "image/jpeg", 4: "image/webp", 5: "image/avif"}
"""Tile types that are pictures, with their media types."""
_MAGIC, _VERSION = b"PMTiles", 3
_TYPE_AT = 99
_VECTOR = 1


def archive_problem(head: bytes) -> str:
    """Return why the console cannot show an archive with this header; empty if it can."""
    if len(head) < HEAD or not head.startswith(_MAGIC):
        return "it is no PMTiles archive"
    if head[len(_MAGIC)] != _VERSION:
        return f"it is PMTiles version {head[len(_MAGIC)]}; the console reads version {_VERSION}"
    if head[_TYPE_AT] == _VECTOR:
        return "its tiles are vectors; the console shows pictures (PNG, JPEG, WebP, AVIF)"
    if head[_TYPE_AT] not in MEDIA_TYPES:
        return f"its tiles are of the unknown type {head[_TYPE_AT]}"
    return ""


def raster_archive(path: Path) -> Path:
    """Refuse a file that is unreadable or no archive of pictures."""
    try:
        with path.open("rb") as file:
            problem = archive_problem(file.read(HEAD))
    except OSError as error:
        problem = f"it cannot be read: {error.strerror}"
    if problem:
        raise ValueError(f"{path}: {problem}")
    return path
