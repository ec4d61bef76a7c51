"""Reads files that a vehicle serves over MAVLink FTP; one request at a time."""

from __future__ import annotations

import contextlib
import struct

import msgspec

from fleet import CommandError, LinkLost, Refused, TimedOut
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.event_messages import FileTransfer
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.vehicle import Vehicle

_TERMINATE, _OPEN, _READ, _CRC = 1, 4, 5, 14  # opcodes
_ACK = 128
_HEAD = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, requested opcode, burst, offset
_PAYLOAD, _DATA = 251, 239
_WITHIN, _TRIES = 1.0, 4
MOST_BYTES = 1 << 20


class FtpAnswer(msgspec.Struct, frozen=True):
    """Answer to one request."""

    sequence: int
    session: int
    opcode: int
    data: bytes

    @classmethod
    def of(cls, message: FileTransfer) -> FtpAnswer:
        """Decode the payload of a message."""
        payload = bytes(message.payload)
        sequence, session, opcode, size, _, _, _ = _HEAD.unpack_from(payload)
        return cls(sequence, session, opcode, payload[_HEAD.size : _HEAD.size + min(size, _DATA)])


class FtpClient:
    """MAVLink FTP client of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._sequence = 0

    async def checksum(self, path: str) -> int:
        """Return the file's CRC32; raises Refused if there is no such file, TimedOut without an answer."""
        with self._vehicle.hearing(FileTransfer) as heard:
            data = (await self._request(heard, _CRC, 0, 0, path.encode())).data
        return int.from_bytes(data[:4], "little")

    async def read(self, path: str) -> bytes:
        """Return a whole file; raises Refused if it is missing or too large, TimedOut without an answer.

        PX4 has one session, which has no timeout: left open, it serves no file until it restarts.
        """
        with self._vehicle.hearing(FileTransfer) as heard:
            try:
                opened = await self._request(heard, _OPEN, 0, 0, path.encode())
            except Refused:
                raise  # another station may have the session
            except BaseException:
                self._abandon(0)  # it may have been opened, although no answer was received
                raise
            try:
                data = await self._contents(heard, path, opened)
            except BaseException:
                self._abandon(opened.session)
                raise
            with contextlib.suppress(CommandError):
                await self._request(heard, _TERMINATE, opened.session, 0, b"")
        return data

    async def _contents(self, heard: ReceivedMessages[FileTransfer], path: str, opened: FtpAnswer) -> bytes:
        """Read an open file."""
        size = int.from_bytes(opened.data[:4], "little")
        if size > MOST_BYTES:
            raise Refused(f"{path} has {size} bytes, more than {MOST_BYTES}")
        found = bytearray()
        while len(found) < size:
            piece = (await self._request(heard, _READ, opened.session, len(found), b"")).data
            if not piece:
                raise Refused(f"{path} ended at {len(found)} of {size} bytes")
            found += piece
        return bytes(found[:size])

    def _abandon(self, session: int) -> None:
        """Close a session at once; with a new sequence number, or PX4 takes it for a repeated request."""
        self._sequence = (self._sequence + 1) & 0xFFFF
        with contextlib.suppress(LinkLost):
            self._send(_TERMINATE, session, 0, b"")

    def _send(self, opcode: int, session: int, offset: int, data: bytes) -> None:
        """Send a request."""
        size = _DATA if opcode == _READ else len(data)  # bytes to read, or bytes in the request
        head = _HEAD.pack(self._sequence, session, opcode, size, 0, 0, offset)
        payload = tuple((head + data).ljust(_PAYLOAD, b"\0"))
        self._vehicle.send(FileTransfer(0, self._vehicle.system, AUTOPILOT, payload))

    async def _request(
        self, heard: ReceivedMessages[FileTransfer], opcode: int, session: int, offset: int, data: bytes
    ) -> FtpAnswer:
        """Send a request until it is answered; repeats keep their sequence number, so it is executed once."""
        self._sequence = (self._sequence + 1) & 0xFFFF
        expected = (self._sequence + 1) & 0xFFFF
        for _ in range(_TRIES):
            self._send(opcode, session, offset, data)
            said = await heard.first(lambda each: FtpAnswer.of(each).sequence == expected, _WITHIN)
            if said is None:
                continue
            self._sequence = expected
            answer = FtpAnswer.of(said)
            if answer.opcode != _ACK:
                raise Refused(f"it refused a file: error {answer.data[0] if answer.data else '?'}")
            return answer
        raise TimedOut(f"system {self._vehicle.system} serves no files")
