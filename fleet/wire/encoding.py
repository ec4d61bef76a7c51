"""JSON encoding of model values that never writes NaN or infinity."""

from __future__ import annotations

import math
from collections.abc import Iterator

import msgspec

from fleet.errors import WireError
from fleet.wire.strict_json import path

UNSAYABLE = (TypeError, ValueError, OverflowError, RecursionError)
"""Exceptions of msgspec for a value that it cannot encode."""
_encode = msgspec.json.Encoder().encode


def encode_finite(value: object) -> bytes:
    """Return ``value`` (builtins and msgspec structs) as JSON.

    Raises WireError with the place of a number that is not finite, and for what JSON cannot hold.
    """
    try:
        encoded = _encode(value)
        # The encoder writes null for NaN and infinity, so only a text with null needs the closer check.
        # (``in`` instead of ``find`` takes eight times as long: it first tries its operand as an integer.)
        if encoded.find(b"null") >= 0:
            for where in _not_finite(msgspec.to_builtins(value), ""):
                raise WireError("not a finite number", where=where)
    except UNSAYABLE as error:
        raise WireError(f"cannot be sent as JSON: {error}") from None
    return encoded


def _not_finite(value: object, where: str) -> Iterator[str]:
    """Yield the dotted paths of the numbers in ``value`` that are not finite."""
    if isinstance(value, float):
        if not math.isfinite(value):
            yield where
    elif isinstance(value, dict):
        for name, member in value.items():
            yield from _not_finite(member, path(where, str(name)))
    elif isinstance(value, list | tuple):
        for index, member in enumerate(value):
            yield from _not_finite(member, path(where, str(index)))
