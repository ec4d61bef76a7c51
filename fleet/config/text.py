"""Texts for users: printable text, and the most similar known word."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator


def printable(text: str) -> str:
    """Return text that cannot control a terminal: unprintable characters are written as escapes."""
    if text.isprintable():
        return text
    return "".join(character if character.isprintable() else _escaped(character) for character in text)


def _escaped(character: str) -> str:
    """Return a tab as a space (carets must stay aligned), other characters as escapes."""
    return " " if character == "\t" else character.encode("unicode_escape").decode()


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``did you mean 'x'?`` for the most similar known word, or nothing."""
    near = difflib.get_close_matches(word.lower(), sorted(known), n=1)
    return f"did you mean {near[0]!r}?" if near else ""


def texts_in(value: object) -> Iterator[str]:
    """Yield every text in the data of a file, without the keys of mappings."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from texts_in(each)
    elif isinstance(value, list):
        for each in value:
            yield from texts_in(each)
