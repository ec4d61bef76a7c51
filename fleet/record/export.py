"""Contents of a folder of recordings, and export of a window of it to one file."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

import msgspec
from mcap.exceptions import McapError
from mcap.reader import McapReader, NonSeekingReader, make_reader
from mcap.records import Channel, Message, Schema
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from fleet.errors import StateError
from fleet.record.file import CHUNK
from fleet.record.ring import begin_of, files_in

BROKEN = (McapError, ZstdError, EOFError, ValueError, OverflowError, struct.error)
"""Exceptions of readers for a damaged or truncated file."""


FromFile = tuple[Schema | None, Channel, Message]
"""A message with its channel and the channel's schema."""


class RecordingSummary(msgspec.Struct, frozen=True):
    """One file: ``begins`` and ``ends`` are Unix s; ``messages`` is None for one without an index."""

    path: str
    size: int
    begins: float
    ends: float
    messages: int | None = None


def recorded_in(folder: Path) -> list[RecordingSummary]:
    """Return the files of a folder, oldest first; raises StateError if there is no such folder."""
    if not folder.is_dir():
        raise StateError(f"there is no folder {folder}: nothing was recorded there")
    return [recorded(path) for path in files_in(folder)]


def recorded(path: Path) -> RecordingSummary:
    """Return the properties of a file: from its index, else from its name and modification time."""
    found = path.stat()
    with path.open("rb") as file:
        try:
            summary = make_reader(file).get_summary()
        except (*BROKEN, OSError):  # OSError: it is shorter than the end of a file
            summary = None
    if summary is None or summary.statistics is None:
        return RecordingSummary(str(path), found.st_size, begin_of(path) or found.st_mtime, found.st_mtime)
    counted = summary.statistics
    begins, ends = counted.message_start_time / 1e9, counted.message_end_time / 1e9
    return RecordingSummary(str(path), found.st_size, begins, ends, counted.message_count)


def export(folder: Path, into: Path, *, since: float, until: float) -> int:
    """Write the messages received from ``since`` until before ``until`` (Unix s) to a new file.

    Returns the number of messages. The file is for this user only, and has an index. Raises StateError if
    nothing was recorded then, or if the file exists.
    """
    messages = window([folder], since, until)
    try:
        with os.fdopen(os.open(into, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as output:
            count = copy(messages, output)
    except FileExistsError:
        raise StateError(f"{into} is there already; choose another name") from None
    except OSError as error:
        raise StateError(f"{into} cannot be written: {error.strerror or error}") from None
    if not count:
        into.unlink()
        raise StateError(f"{folder} has no data of that time; fleet record ls lists the recorded times")
    return count


def window(folders: Iterable[Path], since: float, until: float) -> Iterator[FromFile]:
    """Yield the messages received from ``since`` until before ``until`` (Unix s); raises StateError."""
    found = [file for folder in folders for file in recorded_in(folder)]
    return messages_of([file for file in found if file.ends >= since and file.begins <= until], since, until)


def copy(messages: Iterable[FromFile], output: IO[bytes]) -> int:
    """Write messages as a file with an index; returns their number. ``output`` need not be a file."""
    writer = Writer(output, chunk_size=CHUNK, compression=CompressionType.ZSTD)
    writer.start()
    schemas: dict[str, int] = {}
    channels: dict[tuple[str, str], int] = {}
    count = 0
    for schema, channel, message in messages:
        name = schema.name if schema is not None else ""
        if schema is not None and name not in schemas:
            schemas[name] = writer.register_schema(name, schema.encoding, schema.data)
        if (channel.topic, name) not in channels:
            number = schemas.get(name, 0)
            channels[channel.topic, name] = writer.register_channel(
                channel.topic, channel.message_encoding, number
            )
        writer.add_message(
            channels[channel.topic, name],
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )
        count += 1
    writer.finish()
    return count


def messages_of(files: list[RecordingSummary], since: float, until: float) -> Iterator[FromFile]:
    """Yield the messages of a window; a truncated file ends at the truncation."""
    start = max(0, round(since * 1e9))
    end = round(until * 1e9) if math.isfinite(until) else None
    for recorded in files:
        with Path(recorded.path).open("rb") as file:
            try:
                yield from _messages_in(file, start, end)
            except BROKEN:
                continue


def _messages_in(file: IO[bytes], start: int, end: int | None) -> Iterator[FromFile]:
    """Yield the messages of one file; in a truncated one, in the order in which they were written."""
    reader: McapReader = make_reader(file)
    try:
        reader.get_summary()
    except (*BROKEN, OSError):  # the reader needs the end of the file, and sorting would need all of it
        file.seek(0)
        reader = NonSeekingReader(file)
        yield from reader.iter_messages(log_time_order=False, starting_at=start, ending_before=end)
    else:
        yield from reader.iter_messages(starting_at=start, ending_before=end)
