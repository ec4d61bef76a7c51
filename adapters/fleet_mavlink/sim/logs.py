"""On-board logs of a simulated vehicle, and the answers to the LOG messages."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any

from pymavlink.dialects.v20 import all as mav

_PIECE = 90
_PACE = 20  # pieces sent per step of the vehicle
_BEGAN = 1_790_000_000  # Unix seconds of the first log
_SIZES = (40_000, 12_345, 3_600)  # bytes; the last is a whole number of pieces


def content(number: int, size: int) -> bytes:
    """Return the bytes of a log: the same for the same number and size."""
    return Random(number).randbytes(size)  # noqa: S311 - reproducible, not secret


class SimLogs:
    """The logs of one vehicle; ``first`` is the number of the oldest (ArduPilot 1, PX4 0)."""

    def __init__(self, first: int) -> None:
        self._sizes = {first + place: size for place, size in enumerate(_SIZES)}
        self._number = 0
        self._data = b""
        self._at = self._end = 0

    def reboot(self) -> None:
        """End the transfer."""
        self._at = self._end = 0

    def requested_list(self, message: Any) -> Iterable[object]:
        """Answer LOG_REQUEST_LIST with an entry for each log."""
        last = max(self._sizes)
        return [
            mav.MAVLink_log_entry_message(number, len(self._sizes), last, _BEGAN + 3600 * number, size)
            for number, size in self._sizes.items()
            if message.start <= number <= message.end
        ]

    def requested_data(self, message: Any) -> Iterable[object]:
        """Begin to send a part of a log; nothing beyond its end."""
        size = self._sizes.get(message.id, 0)
        if message.id != self._number or not self._data:
            self._data = content(message.id, size)
        self._number, self._at = message.id, message.ofs
        self._end = min(size, message.ofs + message.count)
        return ()

    def requested_end(self) -> Iterable[object]:
        """End the transfer."""
        self.reboot()
        return ()

    def pending(self) -> list[object]:
        """Return the next LOG_DATA messages."""
        if self._at >= self._end:
            return []
        pieces: list[object] = []
        while self._at < self._end and len(pieces) < _PACE:
            part = self._data[self._at : min(self._at + _PIECE, self._end)]
            padded = list(part.ljust(_PIECE, b"\0"))
            pieces.append(mav.MAVLink_log_data_message(self._number, self._at, len(part), padded))
            self._at += len(part)
        return pieces
