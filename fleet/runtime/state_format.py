"""Format numbers of state files: an older format is read, a newer one is refused and kept.

Every file in which a process leaves state for the next one has a format number. It grows by one with each
change that older readers would misread.

=====================  ==========================  ===================================================
file                   place of the number         without a number
=====================  ==========================  ===================================================
SQLite                 ``PRAGMA user_version``     0: an empty file, which is initialised
execution journal      its first row               0: the rows of fleet 0.1.0, which are those of 1
lines of the log       the field ``format``        1
configuration.json     the field ``format``        refused; it is written anew at the next start
rehearsals.json        the field ``format``        a list of passes, which are those of 1
console-people.json    the field ``format``        1
seen-edges.json        the field ``format``        refused; a person removes the file
rollout-state.json     the field ``format``        1
entries of a roll-out  the field ``format``        refused
bundles, backups       the field ``format``        refused
=====================  ==========================  ===================================================

Files in foreign formats (candump captures, PX4's list of events) have no number.
"""

from __future__ import annotations

import msgspec

from fleet.errors import StateNewer
from fleet.runtime.decoding import decode_json


class _Format(msgspec.Struct, frozen=True):
    format: int


def format_of(data: bytes) -> int:
    """Return the format number of a JSON object; raises msgspec.DecodeError without one."""
    return decode_json(data, _Format).format


def refuse_newer(found: int, newest: int) -> None:
    """Raise StateNewer for a format number above ``newest``, the one that this fleet writes."""
    if found > newest:
        raise StateNewer(
            f"it has format {found}, of a newer fleet; this one reads up to format {newest}", found=found
        )
