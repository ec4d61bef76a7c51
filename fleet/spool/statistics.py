"""Statistics of a spool: waiting messages of each class, their age, and losses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from fleet.spool.losses import Reason
from fleet.spool.memory_buffer import DURABLE
from fleet.spool.topic_queue import TopicQueue
from fleet.wire.rules import TrafficClass

SECOND = 1e6
"""Sequence numbers in a second: the number of a message is the Unix time of its queueing in µs."""


class ClassStatistics(msgspec.Struct):
    """The waiting messages of one class: ``on_disk`` of them are on disk only, the others in memory.

    ``memory`` is bytes of payload there. ``oldest`` is the queueing time (Unix s) of the first; None if there
    is none.
    """

    messages: int = 0
    on_disk: int = 0
    memory: int = 0
    oldest: float | None = None


class SpoolStatistics(msgspec.Struct, frozen=True):
    """Statistics of a spool. ``disk`` is bytes in use of its file, of all classes."""

    classes: Mapping[TrafficClass, ClassStatistics]
    lost: Mapping[tuple[TrafficClass, Reason], int]
    held_topics: int
    disk: int
    problem: str


def class_statistics(queues: Iterable[TopicQueue]) -> dict[TrafficClass, ClassStatistics]:
    """Return the statistics of each class."""
    classes = {traffic: ClassStatistics() for traffic in DURABLE}
    for queue in queues:
        _add(queue, classes[queue.traffic])
    return classes


def _add(queue: TopicQueue, to: ClassStatistics) -> None:
    """Add the figures of one topic."""
    in_memory = [message for message in (*queue.back, *queue.memory) if not message.gone]
    to.messages += len(in_memory) + queue.on_disk
    to.on_disk += queue.on_disk
    to.memory += sum(len(message.payload) for message in in_memory)
    if in_memory or queue.on_disk:
        first = (min(message.seq for message in in_memory) if in_memory else queue.oldest_on_disk) / SECOND
        to.oldest = first if to.oldest is None else min(first, to.oldest)
