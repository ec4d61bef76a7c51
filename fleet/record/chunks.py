"""The chunks of an MCAP file, found without its index: a file in progress is read like a finished one.

A chunk has its times in its header, and the index records after it list its channels: so a search for a few
messages decompresses only a few chunks. Source: https://mcap.dev/spec.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk as ChunkRecord
from mcap.stream_reader import get_chunk_data_stream

from fleet.record.export import BROKEN

_BLOCK = 64 * 1024  # bytes per read
_MAGIC = 8  # bytes before the first record
_RECORD = struct.Struct("<BQ")  # opcode, length of the content
_CHUNK = struct.Struct("<QQQI")  # first and last time, uncompressed size, checksum
_TEXT = struct.Struct("<I")  # length of a text
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence number, received and stamp in Unix ns
_NUMBER = struct.Struct("<H")
_CHANNEL = struct.Struct("<HH")  # its id, its schema
LARGEST = 64 * 1024 * 1024
"""Limit of a decompressed chunk in bytes; a recorder writes no larger ones."""


class Chunk(msgspec.Struct, frozen=True):
    """One chunk: its times (Unix ns), the position of its record, and its channels as a bit mask of ids."""

    begins: int
    ends: int
    at: int
    size: int
    channels: int


class RecordedTopic(msgspec.Struct, frozen=True):
    """A topic of the file, with the name of its schema."""

    topic: str
    schema: str


class RawMessage(msgspec.Struct, frozen=True):
    """A recorded message; times in Unix ns."""

    channel: int
    received: int
    stamp: int
    data: bytes


class Chunks:
    """The chunks of the file at ``path``, oldest first; ``refresh`` adds the ones written since.

    Raises OSError if the file cannot be read; damaged parts are skipped. ``is_cut``: the file has no end, so
    that what followed is lost. ``damaged`` are the positions of the chunks that could not be read completely.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: list[Chunk] = []
        self.channels: dict[int, RecordedTopic] = {}
        self.is_cut = False
        self.damaged: set[int] = set()
        self._schemas: dict[int, str] = {}
        self._at = _MAGIC

    def refresh(self) -> None:
        """Find the records written since the last call."""
        with self.path.open("rb", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            self.is_cut = True
            begin, block = self._at, b""
            while True:
                if self._at + _RECORD.size + _CHUNK.size > begin + len(block):
                    begin, block = self._at, os.pread(file.fileno(), _BLOCK, self._at)
                at = self._at - begin
                if len(block) < at + _RECORD.size + _CHUNK.size:
                    return
                opcode, length = _RECORD.unpack_from(block, at)
                if opcode == Opcode.DATA_END:
                    self.is_cut = False
                    return
                if length > size - self._at:  # the file has grown, or is damaged
                    size = os.fstat(file.fileno()).st_size
                if not 0 < length <= size - self._at:
                    return
                self._handle_record(file.fileno(), opcode, length, block[at + _RECORD.size :][: _CHUNK.size])
                self._at += _RECORD.size + length

    def _handle_record(self, file: int, opcode: int, length: int, head: bytes) -> None:
        """Handle a record by the first bytes of its content."""
        if opcode == Opcode.CHUNK:
            begins, ends, _, _ = _CHUNK.unpack(head)
            self.found.append(Chunk(begins, ends, self._at + _RECORD.size, length, 0))
        elif opcode == Opcode.MESSAGE_INDEX and self.found:
            (channel,) = _NUMBER.unpack_from(head)
            last = self.found[-1]
            self.found[-1] = msgspec.structs.replace(last, channels=last.channels | 1 << channel)
            if channel not in self.channels:  # its definition is in the first chunk that uses it
                self._unpack(file, last, 0, lambda _: True)

    def messages(self, chunk: Chunk, wanted: int, until: int) -> list[RawMessage]:
        """Return the messages of a chunk on the channels of a bit mask, received by ``until`` (Unix ns)."""
        found: list[RawMessage] = []
        with self.path.open("rb", buffering=0) as file:
            self._unpack(file.fileno(), chunk, wanted, found.append)
        return [message for message in found if message.received <= until]

    def _unpack(self, file: int, chunk: Chunk, wanted: int, take: Callable[[RawMessage], object]) -> None:
        """Read the records of a chunk: schemas, channels, and the messages on the channels ``wanted``."""
        data = _unpacked(os.pread(file, chunk.size, chunk.at))
        if not data:
            self.damaged.add(chunk.at)
        try:
            for opcode, at, length in _records(data):
                if opcode == Opcode.MESSAGE:
                    channel, _, received, stamp = _MESSAGE.unpack_from(data, at)
                    if wanted >> channel & 1 and channel in self.channels:
                        take(RawMessage(channel, received, stamp, data[at + _MESSAGE.size : at + length]))
                elif opcode == Opcode.SCHEMA:
                    (number,) = _NUMBER.unpack_from(data, at)
                    self._schemas[number] = _text(data, at + _NUMBER.size)
                elif opcode == Opcode.CHANNEL:
                    number, schema = _CHANNEL.unpack_from(data, at)
                    topic = _text(data, at + _CHANNEL.size)
                    self.channels[number] = RecordedTopic(topic, self._schemas.get(schema, ""))
        except struct.error:  # the rest is damaged
            self.damaged.add(chunk.at)


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield the records of a chunk: opcode, position of the content, and its length."""
    at = 0
    while at + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        yield opcode, at + _RECORD.size, length
        at += _RECORD.size + length


def _unpacked(content: bytes) -> bytes:
    """Decompress the records of a chunk; empty for a damaged chunk."""
    try:
        chunk = ChunkRecord.read(ReadDataStream(io.BytesIO(content)))
        if chunk.uncompressed_size > LARGEST:
            return b""
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        return stream.read(length)
    except BROKEN:
        return b""


def _text(data: bytes, at: int) -> str:
    """Decode a text in a record."""
    (length,) = _TEXT.unpack_from(data, at)
    return data[at + _TEXT.size : at + _TEXT.size + length].decode(errors="replace")
