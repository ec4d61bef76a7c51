"""Last running configuration of an edge, on disk: for ``fleet diff`` while it is stopped, and renamed robots.

The values are keyed digests, with the key beside them: the file shows whether a value has changed, but no
value. It is written completely or not at all.
"""

from __future__ import annotations

import asyncio
import logging
import os
import secrets
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.config.difference import ComparedFile, outline_of
from fleet.config.load import Loaded
from fleet.errors import StateError
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of, refuse_newer
from fleet.spool.state_folder import create_folder
from fleet.version import __version__

log = logging.getLogger(__name__)

FILE = "configuration.json"
FORMAT = 1


class LastConfiguration(msgspec.Struct, frozen=True):
    """Configuration of an edge; ``stamp``: running since (Unix s), ``fleet``: the version that wrote it."""

    format: int
    fleet: str
    stamp: float
    key: str
    outline: ComparedFile


class LastConfigurationFile:
    """Writes the running configuration of an edge to disk, in the order of the calls.

    On a slow disk the write at the start takes seconds; without an order, it could replace a later one.
    """

    def __init__(self, folder: Path, clock: Clock) -> None:
        self._folder, self._clock = folder, clock
        self._turn = asyncio.Lock()  # first come, first served

    async def write(self, running: Loaded) -> None:
        """Write a configuration; a failure is only logged."""
        stamp = self._clock.time()
        try:
            async with self._turn:
                await asyncio.to_thread(lambda: keep(self._folder, outline_of(running), stamp))
        except StateError as error:
            log.warning("the running configuration is not stored for fleet diff: %s", error)


def keep(folder: Path, outline: ComparedFile, stamp: float) -> None:
    """Write the running configuration; raises StateError. Blocks."""
    key = secrets.token_hex(16)
    kept = LastConfiguration(FORMAT, __version__, stamp, key, outline.digest(key.encode()))
    path = create_folder(folder) / FILE
    new = path.with_suffix(".new")
    try:
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
            file.write(msgspec.json.encode(kept))
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as error:
        raise StateError(f"cannot write {path}: {error.strerror}") from None


def last_configuration(folder: Path) -> LastConfiguration | None:
    """Return the last running configuration of an edge; None where there is none.

    Raises StateError for a file that cannot be read, StateNewer for one of a newer fleet.
    """
    path = folder / FILE
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StateError(f"cannot read {path}: {error.strerror}") from None
    try:
        refuse_newer(format_of(data), FORMAT)
        return decode_json(data, LastConfiguration)
    except msgspec.DecodeError as error:
        raise StateError(f"{path} cannot be read: {error}") from None
