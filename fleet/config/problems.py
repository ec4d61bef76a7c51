"""What is wrong in a file, where, and how to say it: one line each, or with the text and a caret."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

import msgspec

from fleet.config.text import printable
from fleet.errors import ConfigError

Path = tuple[str | int, ...]  # ("robots", 0, "link")

_PAIR = re.compile(r"""(?P<key>[A-Za-z_]\w*)["']?\s*[:=]\s+(?P<value>"[^"]*"?|'[^']*'?|[^\s,}\]#]+)""")
_SECRET_KEYS = ("password", "token", "secret", "passphrase", "api_key", "private_key")
_TAIL_OF_SECRET = ("password", "token", "secret", "passphrase", "_key")


class Mark(msgspec.Struct, frozen=True):
    """A place in a file, counted from 1, and the path that the file itself has there."""

    file: str
    line: int
    column: int
    path: Path = ()


class Problem(msgspec.Struct, frozen=True):
    """One thing wrong in fleet.yaml; ``text`` is the offending line, secrets masked."""

    file: str
    line: int
    column: int
    path: str
    message: str
    text: str = ""
    hint: str = ""

    def __str__(self) -> str:
        """Return it on one line."""
        path = f"{self.path}: " if self.path else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.file}:{self.line}:{self.column}: {path}{self.message}{hint}"

    def shown(self) -> str:
        """Return it with the offending line, a caret under the place, and the hint."""
        path = f"{self.path}: " if self.path else ""
        lines = [f"{self.file}:{self.line}:{self.column}: {path}{self.message}"]
        if self.text.strip():
            indent = len(self.text) - len(self.text.lstrip())
            caret = max(self.column - 1 - indent, 0)
            lines += [f"    {self.text.strip()}", f"    {' ' * caret}^"]
        if self.hint:
            lines.append(f"    {self.hint}")
        return "\n".join(lines)


class InvalidConfig(ConfigError):
    """fleet.yaml cannot be used; ``problems`` holds every reason, in the order of the file."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = sorted(set(problems), key=lambda each: (each.file, each.line, each.column))
        super().__init__("\n".join(str(problem) for problem in self.problems))


def problem_at(mark: Mark, message: str, *, text: str = "", hint: str = "") -> Problem:
    """Return a problem at a place, safe to print: one line each, secrets masked."""
    return Problem(
        file=printable(mark.file),
        line=mark.line,
        column=mark.column,
        path=printable(dotted(mark.path)),
        message=printable(message),
        text=printable(masked(text)),
        hint=printable(hint),
    )


def dotted(path: Sequence[str | int]) -> str:
    """Return a path as people write it: ``robots[0].limits.speed``."""
    words = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return words.removeprefix(".")


def masked(line: str) -> str:
    """Return a line without the values of its passwords and tokens, also where the key is misspelt."""
    return _PAIR.sub(_mask_pair, line)


def _mask_pair(match: re.Match[str]) -> str:
    value = match["value"]
    if value.startswith(("!secret", "!include", "${")) or not _is_secret(match["key"]):
        return match[0]
    return match[0].removesuffix(value) + "*" * len(value)  # as long as it was: carets stay aligned


def _is_secret(key: str) -> bool:
    """Return True when a key names a secret, or nearly so."""
    word = key.lower()
    return word.endswith(_TAIL_OF_SECRET) or bool(difflib.get_close_matches(word, _SECRET_KEYS, 1, 0.7))
