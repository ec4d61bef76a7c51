"""Who asks from a console, and what he may: told by the key, which access rules bind to the console.

A question of a console has more of a key than that of a program: ``.../as/{permission}/{console}``. With
``bus.access`` a console can use only keys with its own name and with permissions that it may give, so both
hold whatever the console's own code does. Programs have no permissions: they may do what their role may.
"""

from __future__ import annotations

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query
from fleet.config.endpoints import COMMON_NAME
from fleet.errors import Refused
from fleet.model.permission import Permission

_WORDS = {each.word: each for each in Permission}


class ConsoleAsker(msgspec.Struct, frozen=True):
    """A console by its identity (``keys.LOCAL`` without a certificate), and its person's permission."""

    console: str
    permission: Permission


def console_asker(question: Query) -> ConsoleAsker | None:
    """Return who asks from a console, None for a program; raises Refused for a malformed key."""
    if not question.suffix:
        return None
    _, _, word, console = question.suffix.split("/")
    known = console == keys.LOCAL or COMMON_NAME.fullmatch(console)
    if word not in _WORDS or not known:
        raise Refused(f"{question.suffix[:40]!a} names no permission and console")
    return ConsoleAsker(console, _WORDS[word])


def console_refusal(question: Query, needed: Permission) -> str:
    """Return why a person at a console may not ask this; empty when he may, and for programs."""
    try:
        asker = console_asker(question)
    except Refused as error:
        return str(error)
    return asker.permission.refusal(needed) if asker is not None else ""
