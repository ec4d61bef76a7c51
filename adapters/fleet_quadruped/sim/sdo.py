"""Minimal SDO server: expedited transfers of objects up to four bytes, and aborts."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fleet import CanFrame
from fleet_quadruped.drives.cia402.frames import SDO_REQUEST, SDO_RESPONSE

NO_OBJECT, TOO_LONG, READ_ONLY, NOT_MAPPABLE = 0x06020000, 0x06070010, 0x06010002, 0x06040041
_UNKNOWN_COMMAND = 0x05040001
_PDO_OFF = 1 << 31


@dataclass(slots=True)
class DictionaryEntry:
    """One object: its size in bytes and its value, unsigned."""

    size: int
    value: int


class SdoServer:
    """Answers SDO requests. ``refusals``: objects whose writes are aborted, with the abort code."""

    def __init__(
        self, node: int, objects: Mapping[tuple[int, int], tuple[int, int]], send: Callable[[CanFrame], None]
    ) -> None:
        self._node = node
        self._send = send
        self.objects = {place: DictionaryEntry(size, value) for place, (size, value) in objects.items()}
        self.refusals: dict[tuple[int, int], int] = {}
        self.unmappable: frozenset[int] = frozenset()  # values that no mapping may have
        self.changed = True  # since the owner last looked

    def handle_frame(self, frame: CanFrame) -> None:
        """Process a frame; all but requests to this node are ignored."""
        if frame.id != SDO_REQUEST + self._node or len(frame.data) != 8:
            return
        command = frame.data[0]
        place = struct.unpack_from("<HB", frame.data, 1)
        kind = command >> 5
        if kind == 1 and command & 2:
            self._download(place, frame.data)
        elif kind == 2:
            self._upload(place)
        elif kind != 4:  # an abort is not answered
            self._abort(place, _UNKNOWN_COMMAND)

    def _upload(self, place: tuple[int, int]) -> None:
        entry = self.objects.get(place)
        if entry is None:
            self._abort(place, NO_OBJECT)
            return
        command = 0x43 | (4 - entry.size) << 2
        self._answer(command, place, entry.value.to_bytes(entry.size, "little"))

    def _download(self, place: tuple[int, int], data: bytes) -> None:
        """Write an object, or abort with the reason."""
        entry = self.objects.get(place)
        size = 4 - (data[0] >> 2 & 3) if data[0] & 1 else 4
        problem = NO_OBJECT if entry is None else self._refusal(place, entry, size)
        if int.from_bytes(data[4 : 4 + size], "little") in self.unmappable:
            problem = NOT_MAPPABLE
        if entry is None or problem:
            self._abort(place, problem)
            return
        entry.value = int.from_bytes(data[4 : 4 + size], "little")
        self.changed = True
        self._answer(0x60, place, b"")

    def _refusal(self, place: tuple[int, int], entry: DictionaryEntry, size: int) -> int:
        """Return the abort code for a write, 0 if it is permitted now."""
        if place in self.refusals:
            return self.refusals[place]
        if size != entry.size:
            return TOO_LONG
        if place[0] in {0x1000, 0x1018, 0x6502}:
            return READ_ONLY
        communication = {0x16: 0x14, 0x1A: 0x18}.get(place[0] >> 8)
        if communication is not None and place[1] > 0:
            number = self.objects[place[0], 0].value
            owner = self.objects[communication << 8 | place[0] & 0xFF, 1].value
            return 0 if number == 0 and owner & _PDO_OFF else 0x08000022
        return 0

    def _abort(self, place: tuple[int, int], code: int) -> None:
        self._answer(0x80, place, code.to_bytes(4, "little"))

    def _answer(self, command: int, place: tuple[int, int], data: bytes) -> None:
        head = struct.pack("<BHB", command, *place)
        self._send(CanFrame(SDO_RESPONSE + self._node, head + data.ljust(4, b"\x00")))
