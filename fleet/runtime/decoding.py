"""Thread-safe decoding with msgspec: the only module that creates typed decoders.

msgspec analyses a Struct type when the type is first used, without a lock: two threads that do so at the same
time crash the process with SIGSEGV (msgspec 0.22, docs/adr/0008-decoders-under-a-lock.md). Here it happens
under one lock, once per type. A test searches for decoders that are created elsewhere.
"""

from __future__ import annotations

import threading
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")

_making = threading.Lock()
_json: dict[object, msgspec.json.Decoder[object]] = {}


def json_decoder(kind: object) -> msgspec.json.Decoder[Any]:
    """Return the shared JSON decoder of a type: a Struct, a union, ``list[str]``."""
    found = _json.get(kind)
    if found is None:
        with _making:
            found = _json.setdefault(kind, msgspec.json.Decoder(kind))
    return found


def msgpack_decoder(kind: object) -> msgspec.msgpack.Decoder[Any]:
    """Return a MessagePack decoder of a type."""
    with _making:
        return msgspec.msgpack.Decoder(kind)


def decode_json(data: bytes | str, kind: type[T]) -> T:
    """Decode JSON to a type; raises msgspec.DecodeError (ValidationError is a subclass)."""
    decoded: T = decode_with(json_decoder(kind), data)
    return decoded


def decode_with(decoder: msgspec.json.Decoder[T], data: bytes | str) -> T:
    """Decode JSON with an existing decoder; raises only msgspec.DecodeError.

    msgspec itself raises UnicodeDecodeError for a string in the JSON that is not UTF-8.
    """
    try:
        return decoder.decode(data)
    except UnicodeDecodeError as error:
        raise msgspec.DecodeError(f"JSON is malformed: {error.reason} in a text") from None


def convert_strictly(value: object, kind: type[T], *, from_attributes: bool = False) -> T:
    """Convert plain values to a type, strictly; raises msgspec.ValidationError."""
    json_decoder(kind)  # makes msgspec analyse the type under the lock
    return msgspec.convert(value, kind, strict=True, from_attributes=from_attributes)
