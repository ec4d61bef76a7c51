"""Files served by simulated autopilots over MAVLink FTP: PX4's event metadata; ArduPilot has none."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.event_list import PACKED, PATH

_HEAD = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, requested opcode, burst, offset
_ACK, _NAK, _FAIL, _END, _UNKNOWN, _NO_FILE = 128, 129, 1, 6, 7, 10
_DATA = 239
FILES: Mapping[str, bytes] = {PATH: PACKED}


def answer(message: Any, files: Mapping[str, bytes]) -> list[object]:
    """Return the answer to one request."""
    payload = bytes(message.payload)
    sequence, session, opcode, size, _, _, offset = _HEAD.unpack_from(payload)
    said = payload[_HEAD.size : _HEAD.size + min(size, _DATA)]
    good, data = _carry_out(opcode, size, offset, said.split(b"\0")[0].decode(errors="replace"), files)
    head = _HEAD.pack((sequence + 1) & 0xFFFF, session, _ACK if good else _NAK, len(data), opcode, 0, offset)
    requester = message.get_srcSystem(), message.get_srcComponent()
    return [mav.MAVLink_file_transfer_protocol_message(0, *requester, list((head + data).ljust(251, b"\0")))]


def _carry_out(
    opcode: int, size: int, offset: int, path: str, files: Mapping[str, bytes]
) -> tuple[bool, bytes]:
    """Return whether a request succeeds, and the data; one file is open at a time."""
    if opcode == mav.MAV_FTP_OPCODE_TERMINATESESSION:
        return True, b""
    if opcode == mav.MAV_FTP_OPCODE_READFILE and files:
        piece = next(iter(files.values()))[offset : offset + min(size, _DATA)]
        return (True, piece) if piece else (False, bytes([_END]))
    if path not in files:
        return False, bytes([_NO_FILE])
    if opcode == mav.MAV_FTP_OPCODE_OPENFILERO:
        return True, len(files[path]).to_bytes(4, "little")
    if opcode == mav.MAV_FTP_OPCODE_CALCFILECRC:
        return True, zlib.crc32(files[path]).to_bytes(4, "little")
    return False, bytes([_UNKNOWN])
