"""The messages of one robot in a window of recordings, read in parts.

The parts are in an order in which the first ones, however many, are spread evenly over the window: who stops
reading early has seen all of its length.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import TypeVar

import msgspec

from fleet.record.chunks import Chunk, Chunks, RecordedTopic
from fleet.record.reading import ReadMessage, message_of

T = TypeVar("T")
_SECOND = 1_000_000_000


class ChunkPart(msgspec.Struct, frozen=True, eq=False):
    """A chunk with messages of the robot, and the robot's channels in its file by id."""

    chunks: Chunks
    chunk: Chunk
    channels: Mapping[int, RecordedTopic]


class Window:
    """The messages on the topics below ``prefix``, received from ``since`` until ``until`` (Unix s).

    ``problems`` describe what cannot be read.
    """

    def __init__(self, prefix: str, since: float, until: float) -> None:
        self.since = since
        self.until = until
        self.problems: list[str] = []
        self._prefix = prefix
        self._begins, self._ends = round(since * _SECOND), round(until * _SECOND)
        self._parts: list[ChunkPart] = []
        self._damaged: Counter[str] = Counter()

    @property
    def parts(self) -> list[ChunkPart]:
        """The parts, in the order in which they are to be read."""
        return spread(sorted(self._parts, key=lambda part: part.chunk.begins))

    def add(self, chunks: Chunks) -> None:
        """Add a file to the window."""
        own = {
            number: each for number, each in chunks.channels.items() if each.topic.startswith(self._prefix)
        }
        mask = sum(1 << number for number in own)
        self._parts += [
            ChunkPart(chunks, chunk, own)
            for chunk in chunks.found
            if self._has(chunk) and chunk.channels & mask
        ]
        known = sum(1 << number for number in chunks.channels)
        if any(chunk.channels & ~known for chunk in chunks.found if self._has(chunk)):
            self.problems.append(f"{chunks.path.name} is damaged: some topics of it cannot be read")
        ends = chunks.found[-1].ends if chunks.found else 0
        if chunks.is_cut and ends < self._ends:
            self.problems.append(f"{chunks.path.name} is damaged or cut off{_after(ends)}")

    def _has(self, chunk: Chunk) -> bool:
        """Return True if a chunk has messages of the window's time."""
        return chunk.ends >= self._begins and chunk.begins <= self._ends

    def read(self, part: ChunkPart, wanted: Callable[[RecordedTopic], bool]) -> list[ReadMessage]:
        """Return the messages of a part on the wanted channels; what cannot be read is a problem."""
        mask = sum(1 << number for number, channel in part.channels.items() if wanted(channel))
        if not mask & part.chunk.channels:
            return []
        try:
            found = part.chunks.messages(part.chunk, mask, self._ends)
        except OSError as error:
            self.problems.append(f"{part.chunks.path.name} cannot be read: {error.strerror or error}")
            return []
        if part.chunk.at in part.chunks.damaged:
            self._damaged[part.chunks.path.name] += 1
        return [
            message_of(part.channels[each.channel], each) for each in found if each.received >= self._begins
        ]

    def all_problems(self) -> list[str]:
        """Return what could not be read, each problem once."""
        damaged = [
            f"{name} is damaged: {count} of its parts cannot be read" for name, count in self._damaged.items()
        ]
        return list(dict.fromkeys([*self.problems, *damaged]))


def spread(items: Sequence[T]) -> list[T]:
    """Return items in an order in which any number of first ones is spread evenly over all of them."""
    bits = max(1, (len(items) - 1).bit_length())
    order = sorted(range(len(items)), key=lambda number: f"{number:0{bits}b}"[::-1])
    return [items[number] for number in order]


def _after(ends: int) -> str:
    """Return from when on a file cannot be read, as text; ``ends`` is Unix ns, 0 for none of it."""
    if not ends:
        return ": nothing of it can be read"
    return f": nothing of it after {datetime.fromtimestamp(ends / _SECOND, UTC):%H:%M:%S} UTC can be read"
