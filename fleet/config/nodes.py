"""YAML text to nodes, and scalars to plain values, by the rules of YAML 1.2.

Only ``true`` and ``false`` are booleans; ``yes``, ``on`` and ``0755`` are text. Tags other than YAML's own
plain ones are left to the caller; a file cannot create Python objects.
"""

from __future__ import annotations

import math
import re
from typing import Any

import yaml

MAX_BYTES = 1_000_000
MAX_DEPTH = 40

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the C parser is five times as fast


class BadYaml(Exception):
    """The text is invalid YAML or exceeds a limit; line and column count from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint
        self.line = line
        self.column = column


class _Loader(_Base):  # type: ignore[misc]  # the base is chosen at run time
    """A loader without implicit resolvers, so that only the rules of this module apply."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 - the name and shape are PyYAML's


_CONTROL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
STR = "tag:yaml.org,2002:str"
_CONSTANTS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,30})")
_HEX_OR_OCTAL = re.compile(r"0x[0-9a-fA-F]{1,16}|0o[0-7]{1,22}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]{1,4})?")
_HINTS = (
    ("did not find expected ','", "${", 'inside {...} and [...] a variable must be quoted: "${NAME}"'),
    ("did not find expected ','", "", "is a comma or a closing bracket or quote missing, here or above?"),
    ("did not find expected node", "", "is a closing bracket or a value missing, here or above?"),
    (
        "mapping values are not allowed",
        "",
        "indent it as the lines around it; text with ': ' must be quoted",
    ),
    ("did not find expected key", "", "indent it as the lines around it"),
    ("did not find expected '-'", "", "indent it as the lines around it"),
    ("could not find expected ':'", "", "a key is followed by a colon and a space"),
    ("found unexpected end of stream", "", "is a closing quote missing?"),
    ("found undefined alias", "", "text that begins with * must be quoted"),
)
"""Hints for parser errors: a part of the message, a text in the line, the hint."""
_SPECIAL = re.compile(r"([-+]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


def decoded(data: bytes) -> str:
    """Return the text of a file; raises BadYaml if it is too long or not UTF-8."""
    if len(data) > MAX_BYTES:
        raise BadYaml(f"the file is longer than {MAX_BYTES} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = error.start - before.rfind(b"\n")
        raise BadYaml("the file is not UTF-8 text", line, column) from None


def compose(text: str) -> yaml.Node | None:
    """Return the root node of the single document in ``text``, None if it is empty; raises BadYaml."""
    control = _CONTROL.search(text)
    if control:
        column = control.start() - text.rfind("\n", 0, control.start())
        raise BadYaml(
            f"the character U+{ord(control[0]):04X} is not allowed in YAML",
            len(text[: control.end()].splitlines()),
            column,
        )
    try:
        _check_depth(text)
        loader = _Loader(text)
        try:
            node: yaml.Node | None = loader.get_single_node()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        raise _bad_from(error, text) from None
    return node


def _check_depth(text: str) -> None:
    """Refuse deep nesting before the composer, which recurses in C."""
    depth = 0
    for event in yaml.parse(text, Loader=_Base):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                mark: Any = event.start_mark
                raise BadYaml(f"nested deeper than {MAX_DEPTH} levels", mark.line + 1, mark.column + 1)
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _bad_from(error: yaml.MarkedYAMLError, text: str) -> BadYaml:
    """Convert a parser's error to one line; tabs get a message of their own."""
    mark: Any = error.problem_mark or error.context_mark
    line, column = (mark.line, mark.column) if mark else (0, 0)
    lines = text.split("\n")
    message = f"{error.problem or error}"
    shown = lines[line] if line < len(lines) else ""
    hint = next((hint for part, words, hint in _HINTS if part in message and words in shown), "")
    if "\t" in shown[: column + 1]:
        message, hint = "a tab cannot indent; use spaces", ""
    elif error.context and error.context not in message:
        message = f"{message} {error.context}"
    return BadYaml(message, line + 1, column + 1, hint=hint)


def scalar(node: yaml.ScalarNode) -> object:
    """Return the value of a scalar node; quoted text stays text."""
    return node.value if node.style else plain(node.value)


def plain(word: str) -> object:
    """Return the value of an unquoted word: null, a boolean, a number, or the word itself."""
    if word in _CONSTANTS:
        return _CONSTANTS[word]
    if _INTEGER.fullmatch(word):
        return int(word)
    if _HEX_OR_OCTAL.fullmatch(word):
        return int(word, 0)
    if _FLOAT.fullmatch(word):
        return float(word)
    special = _SPECIAL.fullmatch(word)
    if special is None:
        return word
    return math.nan if special[3] else float(f"{special[1]}inf")
