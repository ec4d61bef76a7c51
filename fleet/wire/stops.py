"""Recognition of stops, also in malformed messages.

A stop is never refused because of its form. The decoders read well-formed messages; a message that they
refuse is searched here, and is a stop if it names one. A message beyond its size limit is not read: its topic
decides.
"""

from __future__ import annotations

import functools
import json
import re
import unicodedata
from collections.abc import Mapping
from types import MappingProxyType

from fleet.wire.rules import Kind

EMERGENCY = "emergency_stop"
STOP_WORDS = frozenset({"stop", EMERGENCY, "hover", "brake"})
"""Commands that can only end motion: accepted from any sender, at any age, whichever sender has control."""
UNREAD: Mapping[Kind, str] = MappingProxyType({"command": EMERGENCY, "navigate": "stop", "mission": "stop"})
"""Meaning of a message that is too large to read, by kind of request; other kinds are refused."""

_FIELDS = ("command", "type")
_PLAIN = {word.replace("_", ""): word for word in STOP_WORDS} | {"estop": EMERGENCY}
_ENDS_A_TASK = {"cancel": "stop"}  # only on the topics of goals and missions
_STREAMS = frozenset({"velocity_command", "locomotion_velocity"})
_EDGES = frozenset({"edge", "edge_leader", "edge_follower", "sim"})
_LONGEST = 64  # characters of a name
_BETWEEN = re.compile(r"[\W_]+")
# JSON escapes of ASCII letters, in a text that is not valid JSON.
_ESCAPED = re.compile(r"\\u00([0-7][0-9a-fA-F])")
_WORDS = r"e[\W_]{0,2}stop|emergency[\W_]{0,4}stop|stop|hover|brake"
_NAMED = re.compile(rf"(?:command|type)\W{{0,16}}({_WORDS})(?![a-z0-9_])", re.IGNORECASE)
_NAMED_OR_CANCEL = re.compile(rf"(?:command|type)\W{{0,16}}({_WORDS}|cancel)(?![a-z0-9_])", re.IGNORECASE)


@functools.lru_cache(maxsize=256)
def _meant(name: str) -> str:
    """Return the stop that a name means, ignoring case, white space and punctuation; empty for no stop."""
    plain = _BETWEEN.sub("", unicodedata.normalize("NFKC", name)).casefold()
    return _PLAIN.get(plain, "")


def stop_word(name: object) -> str:
    """Return the stop that a name means (``E-Stop`` is ``emergency_stop``); empty when it is no stop."""
    return _meant(name) if isinstance(name, str) and len(name) <= _LONGEST else ""


def releases(name: object, data: object) -> bool:
    """Return True for an ``estop`` that releases: only ``activate: false``, the literal, does."""
    return name == "estop" and isinstance(data, dict) and data.get("activate") is False


def stop_named(message: Mapping[str, object]) -> str:
    """Return the stop that a message names as ``command`` or as ``type``; empty when it names none."""
    for field in _FIELDS:
        name = message.get(field)
        word = "" if name is None or releases(name, message.get("data")) else stop_word(name)
        if word:
            return word
    return ""


def is_reply(message: Mapping[str, object]) -> bool:
    """Return True for an answer that strayed onto a topic on which robots are asked: it has a ``status``.

    A stop with a ``status`` is still a stop, unless its sender is an edge or unknown: a reply to a stop looks
    the same.
    """
    if "status" not in message:
        return False
    sender = message.get("source_type")
    accepts_any_sender = sender is None or (isinstance(sender, str) and sender in _EDGES)
    return accepts_any_sender or not stop_named(message)


def stop_in(payload: bytes, kind: Kind = "command") -> str:
    """Return the stop in a message that its decoder refused; empty when it names none. Never raises.

    JSON is parsed leniently; a text that is not JSON is searched for the name, in any encoding that contains
    the ASCII letters.
    """
    text = payload.replace(b"\0", b"").decode(errors="replace").lstrip("\ufeff\ufffd")
    tasks = kind in ("navigate", "mission")
    try:
        value = json.loads(text, strict=False, object_pairs_hook=_members)
    except (ValueError, RecursionError):
        return _searched(text, tasks=tasks)
    return _of_value(value, tasks=tasks)


def _members(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Build an object; of two values for one key a stop wins, else the last one."""
    members: dict[str, object] = {}
    for name, value in pairs:
        if not stop_word(members.get(name)):
            members[name] = value
    return members


def _of_value(value: object, *, tasks: bool) -> str:
    """Return the stop that a JSON value is, or contains at its top level."""
    if isinstance(value, dict):
        return stop_named(value) or _ended(value, tasks=tasks)
    if isinstance(value, list):
        return next(filter(None, (_of_value(one, tasks=tasks) for one in value if one is not value)), "")
    return stop_word(value)


def _ended(message: Mapping[str, object], *, tasks: bool) -> str:
    """Return ``stop`` for a velocity of duration 0 and for a command that ends a task; else empty."""
    name = message.get("command")
    if not isinstance(name, str):
        return ""
    if name in _STREAMS:
        body = message.get("velocity_command", message.get("data"))
        stands = isinstance(body, dict) and (_is_zero(body.get("duration_ms")) or body.get("gait") == "stand")
        return "stop" if stands else ""
    return _ENDS_A_TASK.get(name.strip().casefold(), "") if tasks else ""


def _is_zero(value: object) -> bool:
    """Return True for the number 0; booleans are no numbers."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value == 0


def _searched(text: str, *, tasks: bool) -> str:
    """Return the stop named in a text that is not JSON and may be truncated; empty for no stop."""
    text = _ESCAPED.sub(lambda found: chr(int(found[1], 16)), text)
    whole = stop_word(text)
    found = None if whole else (_NAMED_OR_CANCEL if tasks else _NAMED).search(text)
    if found is None:
        return whole
    return stop_word(found[1]) or "stop"
