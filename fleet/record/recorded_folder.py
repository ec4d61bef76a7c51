"""A moment of a recording: the newest message of each topic, and the events before it; the files of a window.

The work for a moment is limited, whatever the size of the recording: in files, chunks and events.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from fleet.errors import StateError
from fleet.record.chunks import Chunk, Chunks, RecordedTopic
from fleet.record.reading import ReadMessage, message_of
from fleet.record.ring import begin_of, files_in
from fleet.record.window import Window

MOST_FILES = 2  # files of a folder read for a moment: the file of the moment, and the one before
MOST_IN_WINDOW = 4  # files of a folder read for a window
MOST_CHUNKS = 96  # decompressed for a moment
KEPT = 8  # files with cached chunk lists
SEVERAL: Mapping[str, int] = MappingProxyType({"fleet.Record": 60, "fleet.RunState": 60})
"""Schemas of which a moment has more than the newest message, with the number over all topics."""
_NEWEST = frozenset(
    {
        "fleet.RobotState",
        "fleet.EdgeState",
        "fleet.RobotDescription",
        "fleet.ScheduleAnswer",
        "foxglove.JointStates",
    }
)
_SECOND = 1_000_000_000


class RecordedFolder:
    """One folder of recordings, possibly one in progress. For one thread at a time."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[Path, Chunks] = {}

    def extent(self) -> tuple[float, float] | None:
        """Return the time range of the recordings (Unix s); None without any."""
        files = self._files()
        try:
            return (files[0][0], files[-1][1].stat().st_mtime) if files else None
        except OSError:
            return None

    def at(self, moment: float) -> list[ReadMessage]:
        """Return the messages known at a moment (Unix s), newest first per topic; raises StateError."""
        search = _Search(round(moment * _SECOND))
        for chunks in self._chunks(moment):
            search.search(chunks)
        return search.found

    def track(self, moment: float, seconds: float, most: int) -> list[ReadMessage]:
        """Return positions of the seconds before a moment, oldest first, at up to ``most`` instants.

        Raises StateError.
        """
        until, step = round(moment * _SECOND), round(seconds / most * _SECOND)
        since = due = until - round(seconds * _SECOND)
        found: list[ReadMessage] = []
        for chunks in reversed(list(self._chunks(moment))):
            positions = _mask(chunks, _is_position)
            for chunk in chunks.found:
                if chunk.ends >= max(since, due) and chunk.begins <= until and chunk.channels & positions:
                    due = chunk.ends + step
                    found += {each.topic: each for _, each in _read(chunks, chunk, positions, until)}.values()
        return found

    def find(self, window: Window) -> None:
        """Add the chunks of a window to it."""
        files = self._files()
        ends = [begin for begin, _ in files[1:]] + [math.inf]  # a file ends when the next one begins
        there = [
            path
            for (begin, path), end in zip(files, ends, strict=True)
            if begin <= window.until and end >= window.since
        ]
        if len(there) > MOST_IN_WINDOW:
            window.problems.append(
                f"only the newest {MOST_IN_WINDOW} of {len(there)} files of that time are read"
            )
        for path in there[-MOST_IN_WINDOW:]:
            try:
                window.add(self._looked_at(path))
            except OSError as error:
                window.problems.append(f"{path.name} cannot be read: {error.strerror or error}")

    def _files(self) -> list[tuple[float, Path]]:
        """Return the files with the Unix s at which each began, oldest first."""
        return [(begin, path) for path in files_in(self._folder) if (begin := begin_of(path)) is not None]

    def _chunks(self, moment: float) -> Iterator[Chunks]:
        """Yield the chunks of the files for a moment, newest file first."""
        for _, path in [file for file in self._files() if file[0] <= moment][: -MOST_FILES - 1 : -1]:
            try:
                yield self._looked_at(path)
            except FileNotFoundError:
                continue  # the oldest file, deleted meanwhile
            except OSError as error:
                raise StateError(f"{path} cannot be read: {error.strerror or error}") from None

    def _looked_at(self, path: Path) -> Chunks:
        """Return the chunks of a file as it is now; raises OSError."""
        chunks = self._known.pop(path, None) or Chunks(path)
        chunks.refresh()
        self._known[path] = chunks
        while len(self._known) > KEPT:
            self._known.pop(next(iter(self._known)))
        return chunks


class _Search:
    """The backward search for the messages of a moment; ``until`` is Unix ns."""

    def __init__(self, until: int) -> None:
        self.found: list[ReadMessage] = []
        self._until = until
        self._topics: set[str] = set()
        self._counts: Counter[str] = Counter()
        self._chunks = 0

    def search(self, chunks: Chunks) -> None:
        """Search a file."""
        wanted = _mask(chunks, self._wants)
        for chunk in reversed(chunks.found):
            if self._chunks >= MOST_CHUNKS or not wanted:
                return
            if chunk.begins <= self._until and chunk.channels & wanted:
                self._chunks += 1
                self._add_chunk(chunks, chunk, wanted)
                wanted = _mask(chunks, self._wants)

    def _add_chunk(self, chunks: Chunks, chunk: Chunk, wanted: int) -> None:
        """Add the wanted messages of a chunk, newest first."""
        for channel, message in reversed(_read(chunks, chunk, wanted, self._until)):
            if self._wants(channel):
                self._topics.add(channel.topic)
                self._counts[channel.schema] += 1
                self.found.append(message)

    def _wants(self, channel: RecordedTopic) -> bool:
        """Return True if a message of a channel is still wanted."""
        several = SEVERAL.get(channel.schema)
        if several is not None:
            return self._counts[channel.schema] < several
        is_wanted = channel.schema in _NEWEST or _is_position(channel) or _is_places(channel)
        return is_wanted and channel.topic not in self._topics


def _is_position(channel: RecordedTopic) -> bool:
    """Return True if a channel has the poses of a robot."""
    return channel.schema == "foxglove.PoseInFrame" and channel.topic.endswith("/position")


def _is_places(channel: RecordedTopic) -> bool:
    """Return True if a channel has the goals of an edge's robots."""
    return channel.topic.split("/")[2:3] == ["places"]


def _mask(chunks: Chunks, wanted: Callable[[RecordedTopic], bool]) -> int:
    """Return the wanted channels of a file as a bit mask of ids."""
    return sum(1 << number for number, channel in chunks.channels.items() if wanted(channel))


def _read(chunks: Chunks, chunk: Chunk, wanted: int, until: int) -> list[tuple[RecordedTopic, ReadMessage]]:
    """Return the messages of a chunk in the order of reception; raises StateError."""
    try:
        found = chunks.messages(chunk, wanted, until)
    except OSError as error:
        raise StateError(f"{chunks.path} cannot be read: {error.strerror or error}") from None
    found.sort(key=lambda message: message.received)
    read = ((chunks.channels[message.channel], message) for message in found)
    return [(channel, message_of(channel, message)) for channel, message in read]
