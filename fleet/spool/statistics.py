"""How a spool stands, for people: what waits of each class, how old it is, and what was lost."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from fleet.spool.losses import Reason
from fleet.spool.memory_buffer import DURABLE
from fleet.spool.topic_queue import TopicQueue
from fleet.wire.rules import TrafficClass

SECOND = 1e6
"""Numbers of messages in a second: a message's number is the Unix time at which it was taken."""


class ClassStatistics(msgspec.Struct):
    """What waits of one class: ``on_disk`` of the messages stand on disk alone, the others in memory.

    ``memory`` is bytes of payload there. ``oldest`` is when (Unix s) the first was taken; None when nothing
    waits.
    """

    messages: int = 0
    on_disk: int = 0
    memory: int = 0
    oldest: float | None = None


class SpoolStatistics(msgspec.Struct, frozen=True):
    """How a spool stands. ``disk`` is bytes of its file that hold something, of all classes."""

    classes: Mapping[TrafficClass, ClassStatistics]
    lost: Mapping[tuple[TrafficClass, Reason], int]
    held_topics: int
    disk: int
    problem: str


def class_statistics(lines: Iterable[TopicQueue]) -> dict[TrafficClass, ClassStatistics]:
    """Return what waits of each class."""
    classes = {traffic: ClassStatistics() for traffic in DURABLE}
    for line in lines:
        _add(line, classes[line.traffic])
    return classes


def _add(line: TopicQueue, to: ClassStatistics) -> None:
    """Count in one topic."""
    warm = [message for message in (*line.back, *line.memory) if not message.gone]
    to.messages += len(warm) + line.on_disk
    to.on_disk += line.on_disk
    to.memory += sum(len(message.payload) for message in warm)
    if warm or line.on_disk:
        first = (min(message.seq for message in warm) if warm else line.cold_from) / SECOND
        to.oldest = first if to.oldest is None else min(first, to.oldest)
