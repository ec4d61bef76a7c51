"""The newest value, shared between two processes: one writes, the other reads, neither waits.

The shared memory has a sequence number, a length and a checksum before the value. A torn read has a wrong
checksum; the reader then keeps the previous value.
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
    """Return the descriptor of new shared memory for one value; the caller closes it."""
    descriptor = os.memfd_create("fleet-quadruped", 0)
    os.truncate(descriptor, SIZE)
    return descriptor


class SharedValue(Generic[ValueT]):
    """One shared value; ``sequence`` is the number of the value last read or written."""

    def __init__(self, descriptor: int, kind: type[ValueT]) -> None:
        self._memory = mmap.mmap(descriptor, SIZE)
        self._decoder: msgspec.msgpack.Decoder[ValueT] = msgpack_decoder(kind)
        self._encoder = msgspec.msgpack.Encoder()
        self._lock = threading.Lock()
        self._newest = kind()
        self.sequence = 0

    def put(self, value: ValueT) -> None:
        """Publish a new value; from any thread. Raises ValueError if it is too long."""
        data = self._encoder.encode(value)
        if len(data) > SIZE - _HEAD.size:
            raise ValueError(f"a value of {len(data)} bytes does not fit into {SIZE - _HEAD.size}")
        with self._lock:
            self.sequence += 1
            self._memory[_HEAD.size : _HEAD.size + len(data)] = data
            self._memory[: _HEAD.size] = _HEAD.pack(self.sequence, len(data), zlib.crc32(data))

    def get(self) -> ValueT:
        """Return the newest complete value; the type's defaults before the first."""
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
        """Unmap the memory."""
        self._memory.close()
