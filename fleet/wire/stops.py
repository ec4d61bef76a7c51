"""Which messages are stops, however badly they are written.

A stop is never refused for its form. The decoders read what is right; here is what they refuse: a message
that still names a stop is one. Of a message beyond its size limit nothing is read: where it came decides.
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
"""Commands that can only end motion: obeyed from anyone, at any age, past every lock."""
UNREAD: Mapping[Kind, str] = MappingProxyType({"command": EMERGENCY, "navigate": "stop", "mission": "stop"})
"""What a message means that is too large to be read, where stops come; elsewhere it is refused."""

_FIELDS = ("command", "type")
_PLAIN = {word.replace("_", ""): word for word in STOP_WORDS} | {"estop": EMERGENCY}
_ENDS_A_TASK = {"cancel": "stop"}  # on the topics of goals and missions alone
_STREAMS = frozenset({"velocity_command", "locomotion_velocity"})
_EDGES = frozenset({"edge", "edge_leader", "edge_follower", "sim"})
_LONGEST = 64  # characters of a name
_BETWEEN = re.compile(r"[\W_]+")
_ESCAPED = re.compile(r"\\u00([0-7][0-9a-fA-F])")
_WORDS = r"e[\W_]{0,2}stop|emergency[\W_]{0,4}stop|stop|hover|brake"
_NAMED = re.compile(rf"(?:command|type)\W{{0,16}}({_WORDS})(?![a-z0-9_])", re.IGNORECASE)
_NAMED_OR_CANCEL = re.compile(rf"(?:command|type)\W{{0,16}}({_WORDS}|cancel)(?![a-z0-9_])", re.IGNORECASE)


@functools.lru_cache(maxsize=256)
def _meant(name: str) -> str:
    """Return the stop that a name means, whatever its case, its blanks and its hyphens."""
    plain = _BETWEEN.sub("", unicodedata.normalize("NFKC", name)).casefold()
    return _PLAIN.get(plain, "")


def stop_word(name: object) -> str:
    """Return the stop that a name means (``E-Stop`` is ``emergency_stop``); empty when it is no stop."""
    return _meant(name) if isinstance(name, str) and len(name) <= _LONGEST else ""


def releases(name: object, data: object) -> bool:
    """Return True for an ``estop`` that is to be released: only a literal false does it."""
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

    A stop that has one is a stop all the same, unless an edge says it, or nobody says who does: so answers
    to a stop look.
    """
    if "status" not in message:
        return False
    sender = message.get("source_type")
    anybodys = sender is None or (isinstance(sender, str) and sender in _EDGES)
    return anybodys or not stop_named(message)


def stop_in(payload: bytes, kind: Kind = "command") -> str:
    """Return the stop in a message that its decoder refused; empty when it names none. Never raises.

    JSON is read as kindly as can be, and what is none is searched for the name, in any encoding that has
    the letters of ASCII in it.
    """
    text = payload.replace(b"\0", b"").decode(errors="replace").lstrip("\ufeff\ufffd")
    tasks = kind in ("navigate", "mission")
    try:
        value = json.loads(text, strict=False, object_pairs_hook=_members)
    except (ValueError, RecursionError):
        return _searched(text, tasks=tasks)
    return _of_value(value, tasks=tasks)


def _members(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Make an object of its members; of two values for one key a stop counts, else the last."""
    members: dict[str, object] = {}
    for name, value in pairs:
        if not stop_word(members.get(name)):
            members[name] = value
    return members


def _of_value(value: object, *, tasks: bool) -> str:
    """Return the stop that a JSON value is, or holds at its top."""
    if isinstance(value, dict):
        return stop_named(value) or _ended(value, tasks=tasks)
    if isinstance(value, list):
        return next(filter(None, (_of_value(one, tasks=tasks) for one in value if one is not value)), "")
    return stop_word(value)


def _ended(message: Mapping[str, object], *, tasks: bool) -> str:
    """Return ``stop`` for a velocity of no duration, and for what ends a task; else nothing."""
    name = message.get("command")
    if not isinstance(name, str):
        return ""
    if name in _STREAMS:
        body = message.get("velocity_command", message.get("data"))
        stands = isinstance(body, dict) and (_is_zero(body.get("duration_ms")) or body.get("gait") == "stand")
        return "stop" if stands else ""
    return _ENDS_A_TASK.get(name.strip().casefold(), "") if tasks else ""


def _is_zero(value: object) -> bool:
    """Return True for a number that is nought."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value == 0


def _searched(text: str, *, tasks: bool) -> str:
    """Return the stop that a text names, which is no JSON; it may be cut short."""
    text = _ESCAPED.sub(lambda found: chr(int(found[1], 16)), text)
    whole = stop_word(text)
    found = None if whole else (_NAMED_OR_CANCEL if tasks else _NAMED).search(text)
    if found is None:
        return whole
    return stop_word(found[1]) or "stop"
