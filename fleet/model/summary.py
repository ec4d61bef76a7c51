"""The summary of an edge for the site and the fleet, at most 1 kB."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, cast

import msgspec
from msgspec import Meta

from fleet.errors import WireError
from fleet.model.health import Health
from fleet.runtime.decoding import decode_json

LARGEST = 1024
"""Bytes of an encoded summary: 500 edges with one in 5 s are 100 kB/s."""
LISTED = 5
"""Causes in a summary; the others are only counted."""
NAMED = 3
"""Robot names of a cause."""
LONGEST_CAUSE = 160
LONGEST_LINK = 80

_ORDER = ("ok", "degraded", "offline", "fault")

HealthName = Literal["ok", "degraded", "offline", "fault"]
WordKey = Annotated[str, Meta(pattern=f"^({'|'.join(_ORDER)})$")]
EdgeName = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,62}$")]
ShortText = Annotated[str, Meta(max_length=63)]
Count = Annotated[int, Meta(ge=0, le=1_000_000)]
Seconds = Annotated[float, Meta(ge=0, le=1e11)]


class Trouble(msgspec.Struct, frozen=True, omit_defaults=True):
    """One cause of trouble, and the robots that have it; without robots it is the edge itself.

    ``since`` (Unix s, by the clock of the edge) is when the first of them got its present health. ``kind`` is
    their adapter, empty for several. ``link`` is what they have in common on the path to the edge: a link, or
    ``worker NAME``; empty for nothing. ``names`` are the first ``NAMED`` robots.
    """

    level: HealthName
    cause: Annotated[str, Meta(max_length=LONGEST_CAUSE)]
    since: Seconds
    robots: Count = 0
    kind: ShortText = ""
    link: Annotated[str, Meta(max_length=LONGEST_LINK)] = ""
    names: Annotated[tuple[ShortText, ...], Meta(max_length=NAMED)] = ()


class Summary(msgspec.Struct, frozen=True, omit_defaults=True):
    """An edge in brief: ``robots`` by health; ``stopped``: robots with an emergency stop set.

    ``site`` is ``edge.site`` of its fleet.yaml. ``stamp`` (Unix s) is by its own clock. ``troubles`` are the
    causes, the oldest first; ``more`` is the number of those that did not fit.
    """

    edge: EdgeName
    version: ShortText
    stamp: Seconds
    uptime: Seconds
    site: ShortText = ""
    health: HealthName = "ok"
    robots: dict[WordKey, Count] = {}
    stopped: Count = 0
    troubles: Annotated[tuple[Trouble, ...], Meta(max_length=LISTED)] = ()
    more: Count = 0


def word_of(health: Health | str) -> HealthName:
    """Return the level of a health, or of a word, for a summary; an unknown word is a fault."""
    word = health if isinstance(health, str) else health.level.word
    return cast("HealthName", word) if word in _ORDER else "fault"


def encode(summary: Summary) -> bytes:
    """Return the encoded summary; the least important causes are moved to ``more`` until it fits."""
    encoded = msgspec.json.encode(summary)
    while len(encoded) > LARGEST:
        kept = _without_the_least(summary.troubles)
        summary = msgspec.structs.replace(summary, troubles=kept, more=summary.more + 1)
        encoded = msgspec.json.encode(summary)
    return encoded


def decode(payload: bytes, edge: str) -> Summary:
    """Return the summary received on the key of an edge; raises WireError."""
    if len(payload) > LARGEST:
        raise WireError(f"a summary of {len(payload)} bytes; {LARGEST} are the most")
    try:
        summary = decode_json(payload, Summary)
    except msgspec.DecodeError as error:
        raise WireError(f"a summary that cannot be read: {error}") from None
    if summary.edge != edge:
        raise WireError(f"a summary of edge {summary.edge!r} on the key of {edge!r}")
    return summary


def weight(trouble: Trouble) -> tuple[int, bool, int, float]:
    """Return the importance of a cause: its level, the edge itself before robots, how many, how long."""
    return _ORDER.index(trouble.level), not trouble.robots, trouble.robots, -trouble.since


def _without_the_least(troubles: Sequence[Trouble]) -> tuple[Trouble, ...]:
    """Return all causes but the least important one."""
    least = min(troubles, key=weight)
    return tuple(trouble for trouble in troubles if trouble is not least)
