"""The newest value of something, shared between two processes: one writes, the other reads, nobody waits.

A slot is shared memory with a sequence number, a length and a checksum before the value. A reader that meets
half a value sees a wrong checksum, and takes the value it had.
"""

from __future__ import annotations

import mmap
import os
import struct
import threading
import zlib
from typing import Generic, TypeVar

import msgspec

from fleet import msgpack_decoder

ValueT = TypeVar("ValueT", bound=msgspec.Struct)

SIZE = 8192  # bytes
_HEAD = struct.Struct("<QII")  # sequence number, length, CRC-32
_TRIES = 3


def new_memory() -> int:
    """Return the descriptor of fresh shared memory of one slot; the caller closes it."""
    descriptor = os.memfd_create("fleet-quadruped", 0)
    os.truncate(descriptor, SIZE)
    return descriptor


class SharedValue(Generic[ValueT]):
    """One slot; ``sequence`` is the number of the value that was read or written last."""

    def __init__(self, descriptor: int, kind: type[ValueT]) -> None:
        self._memory = mmap.mmap(descriptor, SIZE)
        self._decoder: msgspec.msgpack.Decoder[ValueT] = msgpack_decoder(kind)
        self._encoder = msgspec.msgpack.Encoder()
        self._lock = threading.Lock()
        self._newest = kind()
        self.sequence = 0

    def put(self, value: ValueT) -> None:
        """Make this the newest value; from any thread. Raises ValueError for one that is too long."""
        data = self._encoder.encode(value)
        if len(data) > SIZE - _HEAD.size:
            raise ValueError(f"a value of {len(data)} bytes does not fit into {SIZE - _HEAD.size}")
        with self._lock:
            self.sequence += 1
            self._memory[_HEAD.size : _HEAD.size + len(data)] = data
            self._memory[: _HEAD.size] = _HEAD.pack(self.sequence, len(data), zlib.crc32(data))

    def get(self) -> ValueT:
        """Return the newest whole value; the kind's defaults before the first."""
        for _ in range(_TRIES):
            sequence, length, check = _HEAD.unpack_from(self._memory)
            if sequence == self.sequence:
                break
            data = self._memory[_HEAD.size : _HEAD.size + min(length, SIZE)]
            if zlib.crc32(data) == check:
                self._newest, self.sequence = self._decoder.decode(data), sequence
                break
        return self._newest

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()
