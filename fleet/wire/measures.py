"""Readers of bounded numbers in messages; a number out of bounds raises WireError with its path."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.errors import WireError
from fleet.wire.strict_json import number, optional_number, path


def positive(members: Mapping[str, object], name: str, where: str = "") -> float | None:
    """Return the optional number ``name``, which must be more than 0; None when it is missing."""
    value = optional_number(members, name, where)
    if value is not None and value <= 0:
        raise _refusal(value, "more than 0", path(where, name))
    return value


def not_negative(members: Mapping[str, object], name: str, where: str = "") -> float | None:
    """Return the optional number ``name``, which must be 0 or more; None when it is missing."""
    value = optional_number(members, name, where)
    if value is not None and value < 0:
        raise _refusal(value, "0 or more", path(where, name))
    return value


def within(members: Mapping[str, object], name: str, where: str, most: float) -> float:
    """Return the required number ``name``, which must be within ``-most`` to ``most``."""
    value = number(members, name, where)
    if abs(value) > most:
        raise _refusal(value, f"-{most:g} to {most:g}", path(where, name))
    return value


def _refusal(value: float, wanted: str, where: str) -> WireError:
    """Return the error for a number out of bounds."""
    return WireError(f"{wanted} is needed, not {value}", where=where)
