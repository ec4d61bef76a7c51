"""Errors in a file with their positions, as one line each, or with the text and a caret."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

import msgspec

from fleet.config.text import printable
from fleet.errors import ConfigError

YamlPath = tuple[str | int, ...]  # ("robots", 0, "link")

_KEY = re.compile(r"""(?P<word>[A-Za-z_]\w*)["']?\s*:\s+""")
_QUOTED = re.compile(r"""\"(?:\\.|[^\"])*\"?|'(?:''|[^'])*'?""")
_IN_BRACES = re.compile(r"[^,}\]]*")
_REST_OF_LINE = re.compile(r".*")
_SECRET_KEYS = ("password", "token", "secret", "passphrase", "api_key", "private_key")
LONGEST_SHOWN = 300  # characters; a longer line is not shown, only its position
_SHORT_SECRETS = ("pw", "pwd", "pin", "psk")
_TAIL_OF_SECRET = ("password", "token", "secret", "passphrase", "_key")


class Mark(msgspec.Struct, frozen=True):
    """A position in a file, counted from 1, and its path in the file."""

    file: str
    line: int
    column: int
    path: YamlPath = ()


class Problem(msgspec.Struct, frozen=True):
    """One error in fleet.yaml; ``text`` is the line of the error, secrets masked."""

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
        """Return it with the line of the error, a caret at the position, and the hint."""
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
    """fleet.yaml cannot be used; ``problems`` has every error, in the order of the file."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = sorted(set(problems), key=lambda each: (each.file, each.line, each.column))
        super().__init__("\n".join(str(problem) for problem in self.problems))


def problem_at(mark: Mark, message: str, *, text: str = "", hint: str = "") -> Problem:
    """Return an error at a position, safe to print: one line each, secrets masked."""
    return Problem(
        file=printable(mark.file),
        line=mark.line,
        column=mark.column,
        path=printable(dotted(mark.path)),
        message=printable(message),
        text=printable(masked(text)) if len(text) <= LONGEST_SHOWN else "",
        hint=printable(hint),
    )


def dotted(path: Sequence[str | int]) -> str:
    """Return a path in the usual notation: ``robots[0].limits.speed``."""
    words = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return words.removeprefix(".")


def masked(line: str) -> str:
    """Return a line without the values of passwords and tokens, also for misspelt keys."""
    shown, at = "", 0
    while key := _KEY.search(line, at):
        value = _value_after(key)
        shown += line[at : key.end()]
        at = key.end()
        if is_secret(key["word"]) and not value.startswith(("!secret", "!include", "${")):
            shown += "*" * len(value)  # same length, so that carets stay aligned
            at += len(value)
    return shown + line[at:]


def _value_after(key: re.Match[str]) -> str:
    """Return the value after a key on its line; rather too much of it than too little."""
    line, at = key.string, key.end()
    plain = _IN_BRACES if "{" in line[: key.start()] else _REST_OF_LINE
    found = _QUOTED.match(line, at) or plain.match(line, at)
    return found[0] if found else ""


def is_secret(key: str) -> bool:
    """Return True if a key names a secret, or nearly so."""
    word = key.lower()
    if word in _SHORT_SECRETS or word.endswith(_TAIL_OF_SECRET):
        return True
    return bool(difflib.get_close_matches(word, _SECRET_KEYS, 1, 0.7))
