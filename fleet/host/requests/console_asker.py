"""Identity and permission of a console's sender, taken from the query's key, which access rules bind.

A console's query has a longer key than a program's: ``.../as/{permission}/{console}``. With ``bus.access`` a
console can use only keys with its own name and with permissions that it may give, so both are true even if
the console's own code is faulty. Programs have no permissions: their role alone decides.
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
    """A console's identity (``keys.LOCAL`` without a certificate) and the permission of its user."""

    console: str
    permission: Permission


def console_asker(question: Query) -> ConsoleAsker | None:
    """Return the console behind a query, None for a program; raises Refused for a malformed key."""
    if not question.suffix:
        return None
    _, _, word, console = question.suffix.split("/")
    known = console == keys.LOCAL or COMMON_NAME.fullmatch(console)
    if word not in _WORDS or not known:
        raise Refused(f"{question.suffix[:40]!a} names no permission and console")
    return ConsoleAsker(console, _WORDS[word])


def console_refusal(question: Query, needed: Permission) -> str:
    """Return why a console's user may not ask this; empty when permitted, and for programs."""
    try:
        asker = console_asker(question)
    except Refused as error:
        return str(error)
    return asker.permission.refusal(needed) if asker is not None else ""
