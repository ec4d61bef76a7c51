"""Format of a parameter file: one ``NAME VALUE`` per line; also reads those of ground stations."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

from fleet.errors import ConfigError

RequestedValues = Mapping[str, float | None]
_SPLIT = re.compile(r"[,\s]+")
_LONGEST = 2_000_000  # bytes


def written(values: RequestedValues, title: str) -> str:
    """Return the content of a file; values that are no numbers are written as comments."""
    lines = [f"# {title}"]
    for name, value in sorted(values.items()):
        lines.append(f"{name} {shown(value)}" if value is not None else f"# {name} is no number")
    return "\n".join(lines) + "\n"


def shown(value: float | None) -> str:
    """Return the shortest text of the same number on the wire, which carries 32 bits."""
    if value is None:
        return "-"
    if value == int(value) and abs(value) < 1e9:
        return str(int(value))
    texts = (f"{value:.{digits}g}" for digits in range(6, 10))
    return next((text for text in texts if same(float(text), value)), repr(value))


def same(one: float | None, other: float | None) -> bool:
    """Return True if two values are equal on the wire."""
    if one is None or other is None or one == other:
        return one == other
    try:
        return struct.pack("<f", one) == struct.pack("<f", other)
    except OverflowError:
        return False


def read(path: Path) -> dict[str, float]:
    """Return the values of a file; raises ConfigError with the line of an error.

    Accepted are ``NAME VALUE``, ``NAME,VALUE``, and the five columns of QGroundControl.
    """
    try:
        text = path.read_text(encoding="utf-8") if path.stat().st_size <= _LONGEST else None
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path} is not UTF-8 text; it is no parameter file") from None
    if text is None:
        raise ConfigError(f"{path}: longer than {_LONGEST} bytes; it is no parameter file")
    return dict(_pairs(path, text))


def _pairs(path: Path, text: str) -> Iterator[tuple[str, float]]:
    """Yield names and values, line by line."""
    for number, line in enumerate(text.splitlines(), 1):
        words = [word for word in _SPLIT.split(line.partition("#")[0].strip()) if word]
        if not words:
            continue
        pair = words[2:4] if len(words) == 5 else words
        value = _finite(pair[1]) if len(pair) == 2 else None
        if value is None:
            raise ConfigError(f"{path}:{number}: {line.strip()!r} is not  NAME VALUE")
        yield pair[0], value


def _finite(text: str) -> float | None:
    """Return the number of a text; None if it is none, or not finite."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
