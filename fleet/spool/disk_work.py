"""Requests of the queue to the disk thread."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import msgspec

from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass


class DiskWork(msgspec.Struct):
    """Changes on disk: messages to insert, sequence numbers to delete."""

    rows: Sequence[Outgoing]
    done: Collection[int]


class FetchRequest(msgspec.Struct, frozen=True):
    """Request for messages of a topic newer than ``after``, at most ``limit``."""

    topic: str
    traffic: TrafficClass
    after: int
    limit: int
