"""MQTT topics and filters (MQTT 5, section 4.7) as pure functions."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

LONGEST = 65_535
"""Limit of a topic or filter, in bytes of UTF-8."""

_Tree = dict[str | None, Any]
"""Filters by level; a filter that ends at a node is stored there under None."""


@functools.lru_cache(maxsize=16384)  # an edge publishes on the same few topics
def check_topic(topic: str) -> str:
    """Return the topic; raise ValueError if no message can be published to it."""
    if "+" in topic or "#" in topic:
        raise ValueError(f"the topic {topic!r} holds a wildcard; publish to one topic")
    return _check_text(topic, "topic")


def check_filter(pattern: str) -> str:
    """Return the filter; raise ValueError if it is invalid."""
    levels = pattern.split("/")
    if "#" in levels[:-1] or any(len(level) > 1 and not {"+", "#"}.isdisjoint(level) for level in levels):
        raise ValueError(f"the filter {pattern!r} must have + alone in its level and # alone in the last")
    return _check_text(pattern, "filter")


def matches(pattern: str, topic: str) -> bool:
    """Return whether the filter matches the topic; a leading wildcard does not match ``$`` topics."""
    if topic.startswith("$") and pattern[0] in "+#":
        return False
    filters, names = pattern.split("/"), topic.split("/")
    for index, level in enumerate(filters):
        if level == "#":
            return True
        if index >= len(names) or level not in ("+", names[index]):
            return False
    return len(filters) == len(names)


def check_apart(patterns: Iterable[str]) -> None:
    """Raise ValueError if a filter is unusable, or if a topic can match two of them.

    A broker may deliver a message once for each matching filter, so a command could be executed twice.
    """
    tree: _Tree = {}
    for pattern in patterns:
        levels = check_filter(pattern).split("/")
        if levels[0] == "$share":
            raise ValueError(f"the filter {pattern!r} is a shared subscription; an edge needs every message")
        if other := _overlapping(tree, levels):
            raise ValueError(f"the filters {other!r} and {pattern!r} overlap: one message would arrive twice")
        node = tree
        for level in levels:
            node = node.setdefault(level, {})
        node[None] = pattern


def _overlapping(node: _Tree, levels: list[str]) -> str | None:
    """Return a filter of the tree that overlaps with these levels."""
    if "#" in node:
        return str(node["#"][None])
    if not levels:
        return node.get(None)
    head, rest = levels[0], levels[1:]
    if head == "#":
        return _any_of(node)
    wanted = [level for level in node if level is not None] if head == "+" else [head, "+"]
    found = (_overlapping(node[level], rest) for level in wanted if level in node)
    return next(filter(None, found), None)


def _any_of(node: _Tree) -> str | None:
    """Return any filter at or below a node."""
    while node and None not in node:
        node = next(iter(node.values()))
    return node.get(None)


def _check_text(text: str, what: str) -> str:
    """Return the text; raise ValueError if MQTT cannot carry it."""
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        raise ValueError(f"the {what} {text!r} is not valid Unicode") from None
    if not 0 < size <= LONGEST or "\0" in text:
        raise ValueError(f"the {what} {text[:60]!r} must have 1 to {LONGEST} bytes and no NUL")
    return text
