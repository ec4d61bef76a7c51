"""STATUSTEXT: joins chunks to complete texts."""

from __future__ import annotations

import re

import msgspec

from fleet_mavlink.messages import StatusTextMessage

CHUNK = 50  # characters of a full chunk
CHUNK_TIMEOUT = 1.0  # s to wait for the next chunk
_OPEN = 8  # incomplete texts kept for one vehicle; the oldest are dropped first
_CONTROL = re.compile(r"[\x00-\x1f\x7f]+")
WARNING = 4  # MAV_SEVERITY: this or lower is a problem


class Sentence(msgspec.Struct, frozen=True):
    """A text of the autopilot, ``severity`` 0 (emergency) to 7 (debug), received at monotonic ``at``."""

    text: str
    severity: int
    at: float
    event: bool = False  # from an EVENT, which a STATUSTEXT often repeats in short


class _Pieces:
    """Received chunks of one text."""

    def __init__(self, severity: int, at: float) -> None:
        self.severity = severity
        self.at = at
        self.texts: dict[int, str] = {}
        self.last: int | None = None

    def whole(self) -> bool:
        """Return True once every chunk up to the last one has arrived."""
        return self.last is not None and all(index in self.texts for index in range(self.last + 1))

    def joined(self) -> str:
        """Return the text, with a mark for each missing chunk."""
        count = max(self.texts) + 1
        return "".join(self.texts.get(index, "[...]") for index in range(count))


class StatusTextAssembler:
    """Joins the chunks of one component's texts; waits 1 s for a missing chunk."""

    def __init__(self) -> None:
        self._open: dict[int, _Pieces] = {}

    def feed(self, piece: StatusTextMessage, now: float) -> list[Sentence]:
        """Process a chunk; return the texts that are complete."""
        if piece.id == 0:
            return _sentences(piece.text, piece.severity, now)
        pieces = self._open.setdefault(piece.id, _Pieces(piece.severity, now))
        pieces.texts[piece.chunk_seq] = piece.text
        if len(piece.text.encode()) < CHUNK:
            pieces.last = piece.chunk_seq
        if pieces.whole():
            return self._close(piece.id)
        return self._close(next(iter(self._open))) if len(self._open) > _OPEN else []

    def late(self, now: float) -> list[Sentence]:
        """Return the texts whose next chunk is overdue."""
        overdue = [key for key, pieces in self._open.items() if now - pieces.at > CHUNK_TIMEOUT]
        return [sentence for key in overdue for sentence in self._close(key)]

    def _close(self, key: int) -> list[Sentence]:
        """Return an incomplete text as it is."""
        pieces = self._open.pop(key)
        return _sentences(pieces.joined(), pieces.severity, pieces.at)


def _sentences(text: str, severity: int, at: float) -> list[Sentence]:
    """Return one text without control characters (PX4 appends a tab); none if empty."""
    clean = _CONTROL.sub(" ", text).strip()
    return [Sentence(clean, severity, at)] if clean else []
