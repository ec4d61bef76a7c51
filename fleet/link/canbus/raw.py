"""Frames of a SocketCAN socket in the kernel's layout, at a third of the cost of python-can.

``struct can_frame`` of linux/can.h: identifier with flags, length, padding, eight bytes; in host byte order.
``struct canfd_frame``: identifier with flags, length, flags of CAN FD, padding, 64 bytes.
"""

from __future__ import annotations

import select
import socket
import struct
from typing import NamedTuple

from fleet.link.canbus.frame import STANDARD_ID, CanFrame, is_foreign

_FRAME = struct.Struct("=IB3x8s")
_FD_FRAME = struct.Struct("=IBB2x64s")
_FAST = 0x05  # CANFD_BRS | CANFD_FDF: CAN FD with the data bit rate
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29
_EXTENDED_ID = 0x1FFFFFFF
_PACKET = _FD_FRAME.size  # the longest


class Packet(NamedTuple):
    """A received frame; ``error``: an error frame; ``unwanted``: to be ignored.

    Unwanted are remote frames, which have no data, foreign ones (``is_foreign``), and truncated ones.
    """

    frame: CanFrame
    error: bool = False
    unwanted: bool = False


def pack(frame: CanFrame) -> bytes:
    """Return a frame in the kernel's layout."""
    identifier = frame.id | _EXTENDED if frame.extended else frame.id
    if frame.fd:
        return _FD_FRAME.pack(identifier, len(frame.data), _FAST, frame.data)
    if frame.remote:
        identifier |= _REMOTE
    return _FRAME.pack(identifier, len(frame.data), frame.data)


def unpack(data: bytes) -> Packet:
    """Return the packet of the kernel's bytes; a truncated frame becomes an empty, unwanted one."""
    if len(data) < _FRAME.size:
        return Packet(CanFrame(0, b""), unwanted=True)
    fd = len(data) >= _FD_FRAME.size
    if fd:
        word, length, _, payload = _FD_FRAME.unpack_from(data)
    else:
        word, length, payload = _FRAME.unpack_from(data)
    if word & _ERROR:
        return Packet(CanFrame(word & _EXTENDED_ID, payload[:length]), error=True)
    extended = bool(word & _EXTENDED)
    identifier = word & (_EXTENDED_ID if extended else STANDARD_ID)
    unwanted = bool(word & _REMOTE) or is_foreign(identifier, extended=extended)
    return Packet(CanFrame(identifier, payload[:length], fd), unwanted=unwanted)


def read(sock: socket.socket, wait: float, most: int) -> list[Packet]:
    """Return the received packets, waiting up to ``wait`` s for the first; raises OSError."""
    if wait > 0 and not select.select([sock], [], [], wait)[0]:
        return []
    packets: list[Packet] = []
    try:
        while len(packets) < most:
            packets.append(unpack(sock.recv(_PACKET, socket.MSG_DONTWAIT)))
    except BlockingIOError:
        pass
    return packets


def write(sock: socket.socket, frame: CanFrame) -> None:
    """Write a frame without waiting; raises OSError (ENOBUFS or EAGAIN for a full queue)."""
    sock.send(pack(frame), socket.MSG_DONTWAIT)
