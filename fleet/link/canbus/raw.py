"""Frames of a SocketCAN socket as the kernel has them: a third of what python-can's own way costs.

``struct can_frame`` of linux/can.h: identifier with flags, length, padding, eight bytes; in the host's order.
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
_FAST = 0x05  # CANFD_BRS | CANFD_FDF: CAN FD, the data at their own bit rate
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29
_EXTENDED_ID = 0x1FFFFFFF
_PACKET = _FD_FRAME.size  # the longest


class Packet(NamedTuple):
    """What was read: a frame, and whether it is one that tells of errors, or one that is for nobody here.

    ``unwanted``: a remote one, which has no data, a foreign one, or one that was cut short.
    """

    frame: CanFrame
    error: bool = False
    unwanted: bool = False


def pack(frame: CanFrame) -> bytes:
    """Return a frame as the kernel takes it."""
    identifier = frame.id | _EXTENDED if frame.extended else frame.id
    if frame.fd:
        return _FD_FRAME.pack(identifier, len(frame.data), _FAST, frame.data)
    if frame.remote:
        identifier |= _REMOTE
    return _FRAME.pack(identifier, len(frame.data), frame.data)


def unpack(data: bytes) -> Packet:
    """Return what the kernel gave; a frame that is cut short is an empty one that nobody wants."""
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
    """Return what has arrived, waiting up to ``wait`` s for the first; raises OSError."""
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
    """Write a frame, now or not at all; raises OSError (ENOBUFS or EAGAIN for a full queue)."""
    sock.send(pack(frame), socket.MSG_DONTWAIT)
