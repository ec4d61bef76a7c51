"""Files served by simulated autopilots over MAVLink FTP: PX4's event metadata; ArduPilot has none."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.event_list import PACKED, PATH

_HEAD = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, requested opcode, burst, offset
_ACK, _NAK = 128, 129
_PAYLOAD, _DATA = 251, 239
_SHORT = 4  # bytes of data; longer answers are not kept
FILES: Mapping[str, bytes] = {PATH: PACKED}


class SimFiles:
    """File server of one autopilot, like PX4's (mavlink_ftp.cpp).

    It has one session, which stays open until it is terminated or the autopilot restarts. A request with the
    sequence number of the last one gets its answer again, and is not carried out; only a long answer is not
    kept, and its request is carried out again.
    """

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self._files = files
        self._open: bytes | None = None  # file of the session
        self._kept: tuple[int, list[object]] | None = None  # the last request's number, and its answer

    def reboot(self) -> None:
        """End the session."""
        self._open = self._kept = None

    def requested(self, message: Any) -> list[object]:
        """Return the answer to one request."""
        payload = bytes(message.payload)
        sequence, session, opcode, size, _, _, offset = _HEAD.unpack_from(payload)
        if self._kept is not None and self._kept[0] == sequence:
            return self._kept[1]
        said = payload[_HEAD.size : _HEAD.size + min(size, _DATA)]
        try:
            code, data = _ACK, self._carry_out(opcode, session, offset, said)
        except _Failure as failure:
            code, data = _NAK, bytes([failure.code])
        head = _HEAD.pack((sequence + 1) & 0xFFFF, 0, code, len(data), opcode, 0, offset)
        requester = message.get_srcSystem(), message.get_srcComponent()
        whole = list((head + data).ljust(_PAYLOAD, b"\0"))
        answers: list[object] = [mav.MAVLink_file_transfer_protocol_message(0, *requester, whole)]
        self._kept = (sequence, answers) if len(data) <= _SHORT else None
        return answers

    def _carry_out(self, opcode: int, session: int, offset: int, said: bytes) -> bytes:
        """Carry out a request; return the data of its answer, or raise _Failure."""
        if opcode == mav.MAV_FTP_OPCODE_CALCFILECRC:
            return zlib.crc32(self._file(said)).to_bytes(4, "little")
        if opcode == mav.MAV_FTP_OPCODE_OPENFILERO:
            if self._open is not None:
                raise _Failure(mav.MAV_FTP_ERR_NOSESSIONSAVAILABLE)
            self._open = self._file(said)
            return len(self._open).to_bytes(4, "little")
        if opcode == mav.MAV_FTP_OPCODE_RESETSESSION:
            self._open = None
            return b""
        if opcode not in {mav.MAV_FTP_OPCODE_READFILE, mav.MAV_FTP_OPCODE_TERMINATESESSION}:
            raise _Failure(mav.MAV_FTP_ERR_UNKNOWNCOMMAND)
        if session != 0 or self._open is None:
            raise _Failure(mav.MAV_FTP_ERR_INVALIDSESSION)
        if opcode == mav.MAV_FTP_OPCODE_TERMINATESESSION:
            self._open = None
            return b""
        if offset >= len(self._open):
            raise _Failure(mav.MAV_FTP_ERR_EOF)
        return self._open[offset : offset + _DATA]  # as much as fits, whatever size was asked for

    def _file(self, said: bytes) -> bytes:
        """Return the file of a path; raises _Failure if there is none."""
        found = self._files.get(said.split(b"\0")[0].decode(errors="replace"))
        if found is None:
            raise _Failure(mav.MAV_FTP_ERR_FILENOTFOUND)
        return found


class _Failure(Exception):
    """A request that is refused, with a MAV_FTP_ERR."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code
