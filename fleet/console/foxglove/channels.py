"""The channels of the live view, created from the samples on the buses; pure."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from collections.abc import Set as AbstractSet

import msgspec

from fleet.console.foxglove.protocol import FoxgloveChannel
from fleet.record.messages import Message
from fleet.record.samples import SampleReader

log = logging.getLogger(__name__)

MOST = 4096  # channels; a fleet of 200 robots has half of them
POLL_INTERVAL = 1.0  # s between checks of unsubscribed reports, whose structure may have changed


class Sample(msgspec.Struct, frozen=True):
    """A message on a channel; ``received`` in Unix ns."""

    channel: int
    received: int
    payload: bytes


class _DecodedKey(msgspec.Struct, frozen=True):
    """The channels of a bus key, and when it was last decoded, in Unix ns."""

    channels: frozenset[int]
    at: int


class Channels:
    """The channels in ``all``, in the order of their numbers; ``newest`` is the newest sample of each."""

    def __init__(self) -> None:
        self.all: list[FoxgloveChannel] = []
        self.newest: dict[int, Sample] = {}
        self._is_full = False
        self._reader = SampleReader()
        self._numbers: dict[tuple[str, str], int] = {}
        self._seen: dict[tuple[str, str], _DecodedKey] = {}

    def convert(
        self, edge: str, samples: Iterable[tuple[str, bytes]], received: int, wanted: AbstractSet[int]
    ) -> list[Sample]:
        """Return the samples of an edge's bus, converted to the channels.

        A report on channels outside ``wanted`` is decoded at most once per second.
        """
        found: list[Sample] = []
        for key, payload in samples:
            if payload and not self._is_idle(edge, key, received, wanted):
                made = [self._sample(each, received) for each in self._reader.read(edge, key, payload)]
                known = [each for each in made if each is not None]
                if len(self._seen) >= MOST:  # keys of robots that are gone, or invented by a sender
                    self._seen.clear()
                self._seen[edge, key] = _DecodedKey(frozenset(each.channel for each in known), received)
                found += known
        return found

    def _is_idle(self, edge: str, key: str, received: int, wanted: AbstractSet[int]) -> bool:
        """Return True if a report need not be decoded now."""
        seen = self._seen.get((edge, key))
        if seen is None or not key.startswith("cw/") or received - seen.at >= POLL_INTERVAL * 1e9:
            return False
        return seen.channels.isdisjoint(wanted)

    def _sample(self, message: Message, received: int) -> Sample | None:
        """Return a message as a sample on its channel, creating new channels; None beyond the limit."""
        name = message.topic, message.schema
        number = self._numbers.get(name)
        if number is None:
            if len(self.all) >= MOST:
                self._leave_out(message.topic)
                return None
            number = self._numbers[name] = len(self.all) + 1
            self.all.append(FoxgloveChannel(number, *name))
        sample = self.newest[number] = Sample(number, received, message.payload)
        return sample

    def _leave_out(self, topic: str) -> None:
        """Log, once, that there are more channels than are shown."""
        if not self._is_full:
            self._is_full = True
            log.warning("Foxglove is shown %d topics at most; %s and later ones are left out", MOST, topic)
