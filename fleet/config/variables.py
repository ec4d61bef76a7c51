"""Environment variables inside a value: ``${VAR}``, ``${VAR:-default}``, ``${VAR:?message}``, ``$$``."""

from __future__ import annotations

import re
from collections.abc import Mapping

_VARIABLE = re.compile(
    r"\$(?:(?P<dollar>\$)"
    r"|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)(?:(?P<how>:[-?])(?P<word>[^}]*))?\}"
    r"|(?P<bad>\{[^}]*\}?))"
)


class UndefinedVariable(Exception):
    """A variable without value and default, or with a syntax error; ``hint`` is the remedy."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


def expand(text: str, environ: Mapping[str, str]) -> str:
    """Return ``text`` with its variables expanded; for :- and :?, an empty variable counts as unset.

    A dollar that starts neither ``${`` nor ``$$`` stays. Raises UndefinedVariable.
    """

    def value(match: re.Match[str]) -> str:
        if match["dollar"]:
            return "$"
        if match["bad"]:
            raise UndefinedVariable(
                f"{match[0]} is no variable", "write ${NAME} or ${NAME:-default}; a plain dollar is $$"
            )
        return _value_of(match["name"], match["how"], match["word"] or "", environ)

    return _VARIABLE.sub(value, text)


def _value_of(name: str, how: str | None, word: str, environ: Mapping[str, str]) -> str:
    """Look one variable up."""
    if how == ":-":
        return environ.get(name) or word
    if how == ":?":
        if not environ.get(name):
            raise UndefinedVariable(f"the environment variable {name} is not set", word)
        return environ[name]
    if name not in environ:
        hint = f"set it, or give a default: ${{{name}:-value}}"
        raise UndefinedVariable(f"the environment variable {name} is not set", hint)
    return environ[name]
