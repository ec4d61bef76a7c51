"""On-board logs: their list, and their content in pieces."""

from __future__ import annotations

import asyncio

import msgspec

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.transfer_messages import LogData, LogEntry, LogRequestData, LogRequestEnd, LogRequestList
from fleet_mavlink.vehicle import Vehicle

MOST_BYTES = 64 * 1024  # in one read
_PIECE = 90  # bytes in a LOG_DATA; a shorter one is the last of its log
_SILENCE = 1.0  # s without a piece after which missing pieces are requested again
_LIST_SILENCE = 3.0  # s; an autopilot searches its card before the first entry
_ROUNDS = 5  # consecutive requests without an answer
_MOST_LOGS = 2000


class OnboardLog(msgspec.Struct, frozen=True):
    """One log on board: its number, bytes, and start in Unix seconds (0: unknown)."""

    id: int
    size: int
    time: int


class LogReader:
    """Reads the logs of one vehicle; only on the ground, because it takes most of the link's capacity."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._lock = asyncio.Lock()

    async def list(self) -> list[OnboardLog]:
        """Return the logs on board, lowest number first; raises TimedOut if the autopilot lists none."""
        self._require_ground()
        async with self._lock:
            with self._vehicle.hearing(LogEntry) as heard:
                found = await self._entries(heard)
        return [found[number] for number in sorted(found)]

    async def read(self, number: int, offset: int, count: int) -> bytes:
        """Return ``count`` bytes of a log from ``offset`` on, fewer at its end."""
        self._require_ground()
        async with self._lock:
            try:
                with self._vehicle.hearing(LogData) as heard:
                    return await _LogTransfer(self._vehicle, number, offset, count).through(heard)
            finally:
                self._vehicle.send(LogRequestEnd(self._vehicle.system, AUTOPILOT))

    async def _entries(self, heard: ReceivedMessages[LogEntry]) -> dict[int, OnboardLog]:
        """Request the list until it is complete."""
        found: dict[int, OnboardLog] = {}
        for _ in range(_ROUNDS):
            self._vehicle.send(LogRequestList(self._vehicle.system, AUTOPILOT))
            while (entry := await heard.next(_LIST_SILENCE)) is not None:
                if entry.num_logs == 0:
                    return {}
                if entry.size:
                    found[entry.id] = OnboardLog(entry.id, entry.size, entry.time_utc)
                if len(found) >= min(entry.num_logs, _MOST_LOGS):
                    return found
            require_connection(self._vehicle)
        if found:
            return found
        raise TimedOut(f"system {self._vehicle.system} does not list its logs", hint="has it a card?")

    def _require_ground(self) -> None:
        """Raise NotReady unless it answers, Refused while it is armed."""
        require_connection(self._vehicle)
        if self._vehicle.state.armed:
            raise Refused("it is armed; logs are read on the ground", hint="land and disarm first")


class _LogTransfer:
    """Transfer of one part of one log."""

    def __init__(self, vehicle: Vehicle, number: int, offset: int, count: int) -> None:
        self._vehicle = vehicle
        self._number = number
        self._end = offset + count
        self._at = offset  # complete up to this offset
        self._parts: dict[int, bytes] = {}  # received pieces, by offset
        self._data = bytearray()

    async def through(self, heard: ReceivedMessages[LogData]) -> bytes:
        """Request missing pieces until the part is complete; raises TimedOut or NotReady."""
        fruitless = 0
        while fruitless < _ROUNDS:
            before = len(self._parts) + len(self._data)
            gap = min(self._parts, default=self._end) - self._at
            self._vehicle.send(LogRequestData(self._vehicle.system, AUTOPILOT, self._number, self._at, gap))
            filled = self._at + gap
            while self._at < min(filled, self._end) and (piece := await heard.next(_SILENCE)) is not None:
                self._store(piece)
            if self._at >= self._end:
                return bytes(self._data)
            fruitless = 0 if len(self._parts) + len(self._data) > before else fruitless + 1
            self._require_connection()
        raise TimedOut(f"log {self._number} stopped at {self._at} bytes", hint="ask again from there")

    def _require_connection(self) -> None:
        """Raise NotReady if the vehicle does not answer or was armed in the meantime."""
        require_connection(self._vehicle)
        if self._vehicle.state.armed:
            raise NotReady("it was armed meanwhile", hint="go on after the flight")

    def _store(self, piece: LogData) -> None:
        """Store a piece; a short one marks the end of the log."""
        if piece.id != self._number or not self._at <= piece.ofs < self._end:
            return
        count = min(piece.count, _PIECE, self._end - piece.ofs)
        if piece.count < _PIECE:
            self._end = min(self._end, piece.ofs + piece.count)
        self._parts[piece.ofs] = bytes(piece.data[:count])
        while (part := self._parts.pop(self._at, None)) is not None:
            self._data += part
            self._at += len(part)
            if not part:
                break
