"""Detection of misspelt fields: a message with one is refused, because it would move the robot differently.

Where all fields are known (a command's data), any unknown field is refused. Where a message may carry fields
of other programs (its top level), an unknown field is refused if it resembles a known one.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping

from fleet.errors import WireError
from fleet.wire.strict_json import path

ALIKE = 0.8  # difflib ratio from which two long words count as similar: max_speed, max_speed_ms
SHORT = 5  # letters; shorter words are similar only with a single slip: "date" is not "data"
MOST_FOREIGN = 64  # fields of other programs in one message; comparing more would take too long
LONGEST = 40  # characters; longer names are not compared


def refuse_unknown(members: Mapping[str, object], known: frozenset[str], where: str = "") -> None:
    """Raise WireError for a field that is not ``known``, with the nearest known one as a hint."""
    if members.keys() <= known:
        return
    name = next(name for name in members if name not in known)
    near = _near(name, known)
    hint = f"did you mean {near!r}?" if near else f"it takes {', '.join(sorted(known))}"
    raise WireError(f"is not a field that is read; {hint}", where=path(where, name[:LONGEST]))


def refuse_misspelt(members: Mapping[str, object], read: frozenset[str], where: str = "") -> None:
    """Raise WireError for a field that is not ``read`` but resembles one that is."""
    foreign = [name for name in members if name not in read]
    if len(foreign) > MOST_FOREIGN:
        raise WireError(f"more than {MOST_FOREIGN} fields are not known", where=where or "message")
    for name in foreign:
        near = _near(name, read)
        if near:
            raise WireError(f"is not read; did you mean {near!r}?", where=path(where, name))


def _near(name: str, known: frozenset[str]) -> str:
    """Return the known field that a name resembles, empty when none."""
    if len(name) > LONGEST:
        return ""
    name = name.lower()
    slips = [word for word in known if _is_slip(name, word)]
    long = [word for word in known if len(word) > SHORT]
    return next(iter(slips or difflib.get_close_matches(name, long, n=1, cutoff=ALIKE)), "")


def _is_slip(name: str, word: str) -> bool:
    """Return True when the names differ by one letter more or less, or by two swapped letters."""
    if len(word) < 3 or abs(len(name) - len(word)) > 1:
        return False
    at = next(
        (index for index, (one, other) in enumerate(zip(name, word, strict=False)) if one != other), None
    )
    if at is None:
        return True
    if len(name) == len(word):
        return name[at : at + 2] == word[at : at + 2][::-1] and name[at + 2 :] == word[at + 2 :]
    shorter, longer = sorted((name, word), key=len)
    return shorter[at:] == longer[at + 1 :]
