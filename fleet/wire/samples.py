"""Framing of bus samples: Cyberwave's header, then the payload.

A sample is: u32 length of the header (16 + JSON), f64 Unix seconds, i64 sequence per channel, header JSON
(all little-endian), payload. A plain JSON object without a header is accepted too, as the SDK does.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import msgspec

from fleet.errors import WireError
from fleet.wire.strict_json import parse_object, text

LARGEST_HEADER = 64 * 1024
JSON_TYPE = "application/json"
ARRAY_TYPE = "numpy/ndarray"

_FIXED = struct.Struct("<Idq")
_STAMP_AND_SEQUENCE = 16  # bytes of the fixed part that the length covers
_JSON_HEADER = b'{"content_type":"application/json"}'
_JSON_LENGTH = _STAMP_AND_SEQUENCE + len(_JSON_HEADER)
_JSON_START = _FIXED.size + len(_JSON_HEADER)


def json_sample(payload: bytes, *, stamp: float, sequence: int) -> bytes:
    """Return a JSON payload with its header; ``stamp`` in Unix seconds."""
    return b"".join((_FIXED.pack(_JSON_LENGTH, stamp, sequence), _JSON_HEADER, payload))


def array_sample(
    payload: bytes, *, stamp: float, sequence: int, shape: tuple[int, ...], dtype: str, sensor: str = ""
) -> bytes:
    """Return the bytes of an array with its header, in the form that the SDK writes numpy arrays."""
    header: dict[str, object] = {"content_type": ARRAY_TYPE, "shape": shape, "dtype": dtype}
    if sensor:
        header["sensor_id"] = sensor
    encoded = msgspec.json.encode(header)
    fixed = _FIXED.pack(_STAMP_AND_SEQUENCE + len(encoded), stamp, sequence)
    return b"".join((fixed, encoded, payload))


def json_payload(sample: bytes) -> bytes:
    """Return the JSON payload of a sample: the part after the header, or all of it without a header.

    Raises WireError when it is neither, or when the header declares another content type.
    """
    if len(sample) >= _JSON_START and sample[_FIXED.size : _JSON_START] == _JSON_HEADER:
        return sample[_JSON_START:]
    end = _header_end(sample)
    if end is not None:
        content_type = text(parse_object(sample[_FIXED.size : end]), "content_type", "header")
        if content_type != JSON_TYPE:
            raise WireError(f"{content_type[:40]!a} is not JSON", where="header.content_type")
        return sample[end:]
    if not sample.startswith(b"{"):
        raise WireError("neither a Cyberwave sample nor a JSON object")
    return sample


def stamp_of_header(sample: bytes) -> float | None:
    """Return the stamp (Unix seconds) in a sample's header, None without a header."""
    if _header_end(sample) is None:
        return None
    stamp: float = _FIXED.unpack_from(sample)[1]
    return stamp


def array_parts(sample: bytes) -> tuple[Mapping[str, Any], float, bytes]:
    """Return header, stamp (Unix seconds) and bytes of an array; raises WireError for any other sample."""
    end = _header_end(sample)
    if end is None:
        raise WireError("an array with Cyberwave's header is needed")
    header = parse_object(sample[_FIXED.size : end])
    if text(header, "content_type", "header") != ARRAY_TYPE:
        raise WireError(f"{ARRAY_TYPE} is needed", where="header.content_type")
    return header, _FIXED.unpack_from(sample)[1], sample[end:]


def _header_end(sample: bytes) -> int | None:
    """Return the offset of the header's end, None when the bytes cannot start with a header."""
    if len(sample) < _FIXED.size:
        return None
    length: int = _FIXED.unpack_from(sample)[0]
    if not _STAMP_AND_SEQUENCE <= length <= min(LARGEST_HEADER, len(sample) - 4):
        return None
    return 4 + length
