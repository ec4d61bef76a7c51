"""Strict JSON parser for untrusted input: ambiguous texts and impossible numbers are refused.

The standard parser takes NaN, 1e999, two values for one key and "5" or true as numbers; each of these
has made a robot move. A refusal is a ``WireError`` with the dotted path of the field.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import NoReturn

from fleet.errors import WireError

LARGEST_INTEGER = 2**63 - 1  # the largest integer that JSON readers can be expected to hold


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Build an object; refuse a duplicate key."""
    members = dict(pairs)
    if len(members) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in members if keys.count(key) > 1)
        raise WireError(f"the key {twice[:40]!a} stands twice")
    return members


def _constant(name: str) -> NoReturn:
    """Refuse NaN and the infinities, which are not JSON."""
    raise WireError(f"{name} is not a number")


def _fraction(text: str) -> float:
    """Parse a number with a point or an exponent; refuse one that overflows to infinity."""
    value = float(text)
    if math.isinf(value):
        raise WireError(f"the number {text[:20]} is too large")
    return value


def _integer(text: str) -> int:
    """Parse a whole number; refuse one that does not fit into 64 bits."""
    if len(text) > 20 or abs(value := int(text)) > LARGEST_INTEGER:
        raise WireError(f"the number {text[:20]} is too large")
    return value


_DECODER = json.JSONDecoder(
    object_pairs_hook=_unique, parse_constant=_constant, parse_float=_fraction, parse_int=_integer
)


def parse_json(payload: bytes, *, limit: int = 1 << 20, depth: int = 32) -> object:
    """Parse a JSON text of at most ``limit`` bytes and ``depth`` nested containers.

    Raises WireError for everything else: not UTF-8, not JSON, NaN or infinity, a number beyond 64 bits,
    a duplicate key, half a surrogate pair, trailing data.
    """
    if len(payload) > limit:
        raise WireError(f"{len(payload)} bytes are more than the {limit} that are read")
    try:
        value: object = _DECODER.decode(payload.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise WireError(f"not UTF-8 at byte {error.start}") from None
    except json.JSONDecodeError as error:
        raise WireError(f"not JSON at character {error.pos}: {error.msg}") from None
    except RecursionError:
        raise WireError(f"nested deeper than {depth}") from None
    if payload.count(b"[") + payload.count(b"{") > depth and _deeper(value, depth):
        raise WireError(f"nested deeper than {depth}")
    if b"\\u" in payload:
        _refuse_half_characters(value)
    return value


def _deeper(value: object, depth: int) -> bool:
    """Return True when containers are nested deeper than ``depth``."""
    level = [value]
    for _ in range(depth + 1):
        containers = [node for node in level if isinstance(node, dict | list)]
        level = [
            child for node in containers for child in (node.values() if isinstance(node, dict) else node)
        ]
        if not containers:
            return False
    return True


def _refuse_half_characters(value: object) -> None:
    """Refuse an escaped half of a surrogate pair, which cannot be encoded again."""
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise WireError("half a surrogate pair is not a character") from None


def parse_object(payload: bytes, *, limit: int = 1 << 20, depth: int = 32) -> dict[str, object]:
    """Parse a JSON object; raises WireError like ``parse_json``, and for any other value."""
    value = parse_json(payload, limit=limit, depth=depth)
    if not isinstance(value, dict):
        raise WireError(f"a JSON object is needed, this is {kind(value)}")
    return value


def read_loosely(payload: bytes, name: str, *, limit: int = 1 << 20) -> str:
    """Return a top-level string of an object that was refused, empty where there is none.

    It lets the refusal name its command or action even though another field of the message is invalid.
    """
    try:
        value = json.loads(payload[:limit])
    except (ValueError, RecursionError):
        return ""
    found = value.get(name) if isinstance(value, dict) else None
    return found if isinstance(found, str) else ""


def kind(value: object) -> str:
    """Return the type of a JSON value, in words for an error."""
    names = {dict: "an object", list: "an array", str: "a string", bool: "a boolean", type(None): "null"}
    return names.get(type(value), "a number")


def path(where: str, name: str) -> str:
    """Return the dotted path of ``name`` below ``where``."""
    return f"{where}.{name}" if where else name


def _member(members: Mapping[str, object], name: str, where: str) -> object:
    """Return a required member; raises WireError when it is missing."""
    if name not in members:
        raise WireError("is missing", where=path(where, name))
    return members[name]


def finite(value: object, where: str) -> float:
    """Return ``value`` as a float; raises WireError for a string, a boolean, null or an infinity."""
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise WireError(f"a number is needed, this is {kind(value)}", where=where)
    try:
        measure = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        measure = math.inf
    if not math.isfinite(measure):
        raise WireError("a finite number is needed", where=where)
    return measure


def number(members: Mapping[str, object], name: str, where: str = "") -> float:
    """Return the number ``name``; raises WireError when it is missing or not a finite number."""
    return finite(_member(members, name, where), path(where, name))


def optional_number(members: Mapping[str, object], name: str, where: str = "") -> float | None:
    """Return the optional number ``name``, None when it is missing; null is refused like a string."""
    return number(members, name, where) if name in members else None


def whole(members: Mapping[str, object], name: str, where: str = "") -> int:
    """Return the whole number ``name``; 3.0 is one, as in JSON Schema."""
    value = number(members, name, where)
    if value != int(value):
        raise WireError(f"a whole number is needed, this is {value}", where=path(where, name))
    return int(value)


def text(members: Mapping[str, object], name: str, where: str = "") -> str:
    """Return the string ``name``; raises WireError when it is missing or has another type."""
    value = _member(members, name, where)
    if not isinstance(value, str):
        raise WireError(f"a string is needed, this is {kind(value)}", where=path(where, name))
    return value


def child(members: Mapping[str, object], name: str, where: str = "") -> dict[str, object]:
    """Return the object ``name``; raises WireError when it is missing or has another type."""
    value = _member(members, name, where)
    if not isinstance(value, dict):
        raise WireError(f"an object is needed, this is {kind(value)}", where=path(where, name))
    return value


def without_nulls(members: Mapping[str, object]) -> dict[str, object]:
    """Return the members that are not null, for senders that write null for "not given"."""
    return {name: value for name, value in members.items() if value is not None}
