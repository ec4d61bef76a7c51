"""What the queue asks of the disk."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import msgspec

from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass


class DiskWork(msgspec.Struct):
    """What is to be changed on disk: messages to be added, and numbers of those to be deleted."""

    rows: Sequence[Outgoing]
    done: Collection[int]


class FetchRequest(msgspec.Struct, frozen=True):
    """A topic of which more is wanted from disk, all newer than ``after``."""

    topic: str
    traffic: TrafficClass
    after: int
    limit: int
