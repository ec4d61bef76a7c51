"""One MCAP file of a recording, readable at any time, also after its writer was killed.

Each flush writes the chunk in progress, followed by the end of an MCAP file without an index; the next flush
overwrites that end. A closed file has an index. A writer that was killed while writing the index, or whose
disk was full, may leave half a record: ``repair`` cuts it off. Source: https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from fleet.record.messages import LATEST, Message
from fleet.record.schemas import schema_of
from fleet.version import __version__

CHUNK = 256 * 1024
"""Bytes of a chunk before compression; a larger message has a chunk of its own."""

PARTIAL = ".partial"
"""Name of a file until its header is written; a folder has one recorder."""

_RECORD = struct.Struct("<BQ")  # opcode, length of the content


def _end() -> bytes:
    """Return the end of an MCAP file that has no index."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC


END = _end()


class _BufferedFile:
    """The file for the writer of MCAP: it buffers the data until ``flush`` writes it to the disk."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self._written = 0
        self._waiting = bytearray()

    def write(self, data: bytes) -> int:
        """Buffer bytes."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Return the size of the file including the buffer."""
        return self._written + len(self._waiting)

    def flush(self, end: bytes = END) -> None:
        """Write the buffer and the end of the file; raises OSError, and can be called again.

        The previous end is overwritten last, by a write of a few bytes: until then the file ends for a reader
        where it ended before, also for a concurrent reader, or after this process was killed.
        """
        if self._waiting or not end:
            data, head = bytes(self._waiting), len(END)
            if not self._written:
                _write(self._file, data + end, 0)
            else:
                _write(self._file, end, self._written + len(data))
                _write(self._file, data[head:], self._written + head)
                _write(self._file, data[:head], self._written)
            self._written += len(self._waiting)
            self._waiting.clear()

    def close(self) -> None:
        """Close the file; the buffer is lost."""
        os.close(self._file)


class RecordingFile:
    """A new MCAP file at ``path``, for this user only; raises OSError.

    It gets this name when its header is written, so that nobody finds a file without one. After an OSError in
    ``flush`` it has ``failed``: nothing more can be added; ``close`` it, and ``repair``.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        partial = path.with_name(PARTIAL)
        partial.unlink(missing_ok=True)  # left by a recorder that was killed
        self._output = _BufferedFile(partial)
        output: Any = self._output
        self._writer = Writer(output, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self._counts: dict[int, int] = {}
        self.failed = False
        try:
            self._writer.start(library=f"fleet {__version__}")
            self.flush()
            partial.rename(path)
        except OSError:
            self._output.close()
            partial.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes of the file without the chunk in progress."""
        return self._output.tell()

    @property
    def topics(self) -> int:
        """Number of topics; MCAP has room for 65 535."""
        return len(self._channels)

    def add(self, message: Message, received: int) -> None:
        """Add a message received at ``received`` (Unix ns); it is published at its own stamp, if valid."""
        channel = self._channel(message.topic, message.schema)
        count = self._counts[channel] = self._counts[channel] + 1
        stamp = message.stamp
        published = round(stamp * 1e9) if stamp is not None and 0 <= stamp < LATEST else received
        self._writer.add_message(channel, received, message.payload, published, count)

    def _channel(self, topic: str, schema: str) -> int:
        """Return the channel of a topic, registered with its schema on first use."""
        found = self._channels.get((topic, schema))
        if found is None:
            number = self._schemas.get(schema)
            if number is None:
                number = self._writer.register_schema(schema, "jsonschema", schema_of(schema))
                self._schemas[schema] = number
            found = self._writer.register_channel(topic, "json", number)
            self._channels[topic, schema] = found
            self._counts[found] = 0
        return found

    def flush(self) -> None:
        """Write the added messages to the file; raises OSError."""
        try:
            self._writer.flush()
        except OSError:
            self.failed = True
            raise

    def close(self) -> None:
        """Write the index and close; raises OSError. After a full disk the flushed messages remain."""
        try:
            if not self.failed:
                self._writer.finish()
                self._output.flush(b"")
        finally:
            self._output.close()


def repair(path: Path) -> bool:
    """Cut half a record off the end of a file, and end it; returns True if that was needed.

    Raises OSError. A file that does not start like MCAP is left unchanged.
    """
    with path.open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MCAP0_MAGIC)))
        if file.read() == MCAP0_MAGIC and size > len(MCAP0_MAGIC):
            return False
        file.seek(0)
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return False
        whole = _last_whole_record(file, size)
        _write(file.fileno(), END, whole)
        file.truncate(whole + len(END))
    return True


def _last_whole_record(file: Any, size: int) -> int:
    """Return the end of the last complete record of the data section."""
    at: int = file.tell()
    while at + _RECORD.size <= size:
        file.seek(at)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        end = at + _RECORD.size + length
        if end > size or opcode == Opcode.DATA_END:
            break
        at = end
    return at


def _write(file: int, data: bytes, at: int) -> None:
    """Write all bytes at an offset; raises OSError."""
    view = memoryview(data)
    while view:
        done = os.pwrite(file, view, at)
        view, at = view[done:], at + done
