"""The filters of one MQTT session: what is asked of the broker for them, and what it answers. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

import mqtt5

_FILTERS = 64
"""Filters in one SUBSCRIBE."""


class Subscriptions:
    """What is subscribed to; ``next_id`` gives each request its packet identifier."""

    def __init__(self, filters: Mapping[str, int], next_id: Callable[[], int]) -> None:
        self._filters = filters
        self._next_id = next_id
        self._asked: dict[int, list[str]] = {}

    @property
    def open(self) -> bool:
        """True while a filter is not answered."""
        return bool(self._asked)

    def begin(self) -> Iterator[mqtt5.Packet]:
        """Yield what asks for all filters; what was asked for before counts no more."""
        self._asked.clear()
        return self._subscribe(self._filters.items())

    def change(self, filters: Mapping[str, int]) -> Iterator[mqtt5.Packet]:
        """Yield what asks for other filters; those that stay are not touched, so that nothing is missed."""
        before, self._filters = self._filters, filters
        yield from self._subscribe((each, qos) for each, qos in filters.items() if each not in before)
        gone = [each for each in before if each not in filters]
        for start in range(0, len(gone), _FILTERS):
            yield mqtt5.UnsubscribePacket(self._next_id(), gone[start : start + _FILTERS])

    def answered(self, packet: mqtt5.SubAckPacket) -> list[str] | None:
        """Take an answer; return which filters the broker refuses, None for one that nobody waits for."""
        patterns = self._asked.pop(packet.packet_id, [])
        if len(patterns) != len(packet.reason_codes):
            return None
        return [
            f"the broker refuses the subscription {pattern} ({code.name})"
            for pattern, code in zip(patterns, packet.reason_codes, strict=True)
            if int(code) >= 0x80
        ]

    def _subscribe(self, filters: Iterable[tuple[str, int]]) -> Iterator[mqtt5.Packet]:
        """Ask for some filters; what we publish ourselves must not come back as if somebody asked for it."""
        wanted = [
            mqtt5.TopicFilter(pattern, max_qos=mqtt5.QoS(qos), no_local=True, retain_as_published=False)
            for pattern, qos in filters
        ]
        for start in range(0, len(wanted), _FILTERS):
            identifier, some = self._next_id(), wanted[start : start + _FILTERS]
            self._asked[identifier] = [each.pattern for each in some]
            yield mqtt5.SubscribePacket(identifier, some)
