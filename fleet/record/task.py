"""Task of a recorder: edges, folder and limits."""

from __future__ import annotations

import msgspec

from fleet.bus.settings import BusSettings

MIB = 1024 * 1024
FOLDER = "recordings"
"""The default folder: inside that of an edge's state, or here."""


class Bounds(msgspec.Struct, frozen=True):
    """Limits: bytes and age in seconds of all files; bytes and seconds of one file.

    ``free``: bytes of the disk that stay free for others; below it nothing is recorded.
    """

    size: int = 2048 * MIB
    age: float = 86_400.0
    file_size: int = 64 * MIB
    file_age: float = 600.0
    free: int = 512 * MIB


class RecordTask(msgspec.Struct, frozen=True):
    """One recorder.

    ``edges``: edges to reach besides (or with ``only``, instead of) all that run on this computer.
    ``parent``: the process with which it ends, 0 for none.
    """

    folder: str
    bounds: Bounds = Bounds()
    edges: tuple[BusSettings, ...] = ()
    only: bool = False
    parent: int = 0
