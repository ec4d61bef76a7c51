"""Reading of a recording: its messages in the order of reception."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fleet.errors import StateError
from fleet.record.chunks import RawMessage, RecordedTopic
from fleet.record.export import messages_of, recorded, recorded_in


class ReadMessage(msgspec.Struct, frozen=True):
    """One recorded message: its topic, the name of its schema, and its JSON.

    ``received``: Unix s of its reception by the recorder; ``stamp``: its own stamp, Unix s.
    """

    topic: str
    schema: str
    received: float
    stamp: float
    data: bytes

    @property
    def edge(self) -> str:
        """Its edge; empty for a report of a twin whose edge was not known, and in files of other programs."""
        edge = self.topic.partition("/")[2].partition("/")[0]
        return "" if edge == "twins" else edge

    @property
    def robot(self) -> str:
        """Its robot; for messages of the edge itself another word, or empty."""
        parts = self.topic.split("/")
        return parts[2] if len(parts) > 3 and self.edge else ""


def message_of(channel: RecordedTopic, raw: RawMessage) -> ReadMessage:
    """Return a message that was read from a chunk."""
    return ReadMessage(channel.topic, channel.schema, raw.received / 1e9, raw.stamp / 1e9, raw.data)


def read_recording(path: Path, since: float = 0.0, until: float = math.inf) -> Iterator[ReadMessage]:
    """Yield the messages of a file or folder received from ``since`` until before ``until``.

    Unix s. A truncated file ends at the truncation. Raises StateError if there are no messages.
    """
    if path.is_dir():
        files = [file for file in recorded_in(path) if file.ends >= since and file.begins <= until]
    elif path.is_file():
        files = [recorded(path)]
    else:
        raise StateError(f"there is no file {path}")
    found = False
    for schema, channel, message in messages_of(files, since, until):
        found = True
        name = schema.name if schema is not None else ""
        received, stamp = message.log_time / 1e9, message.publish_time / 1e9
        yield ReadMessage(channel.topic, name, received, stamp, message.data)
    if not found:
        raise StateError(f"{path} has no messages of that time, or is no MCAP file")
