"""What a recorder is to record, and where."""

from __future__ import annotations

import msgspec

from fleet.bus.settings import BusSettings

MIB = 1024 * 1024
FOLDER = "recordings"
"""The folder where nobody says another one: in that of an edge's lasting state, or here."""


class Bounds(msgspec.Struct, frozen=True):
    """How much is kept: bytes of all files, seconds of age; bytes and seconds of one file.

    ``free``: bytes that stay free on the disk for others; below it nothing is recorded.
    """

    size: int = 2048 * MIB
    age: float = 86_400.0
    file_size: int = 64 * MIB
    file_age: float = 600.0
    free: int = 512 * MIB


class RecordTask(msgspec.Struct, frozen=True):
    """One recorder.

    ``edges``: those to reach besides, or with ``only`` instead of, all that run on this computer.
    ``parent``: the process that it ends with, 0 for none.
    """

    folder: str
    bounds: Bounds = Bounds()
    edges: tuple[BusSettings, ...] = ()
    only: bool = False
    parent: int = 0
