"""The subscriptions of one MQTT session: SUBSCRIBE packets and the broker's answers. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

import mqtt5

_FILTERS = 64
"""Filters in one SUBSCRIBE or UNSUBSCRIBE."""


class Subscriptions:
    """The subscribed filters; ``next_id`` returns the packet identifier of each request."""

    def __init__(self, filters: Mapping[str, int], next_id: Callable[[], int]) -> None:
        self._filters = filters
        self._next_id = next_id
        self._requested: dict[int, list[str]] = {}

    @property
    def open(self) -> bool:
        """True while the broker has not answered a SUBSCRIBE."""
        return bool(self._requested)

    def begin(self) -> Iterator[mqtt5.Packet]:
        """Yield the SUBSCRIBE packets for all filters; requests before are forgotten."""
        self._requested.clear()
        return self._subscribe(self._filters.items())

    def change(self, filters: Mapping[str, int]) -> Iterator[mqtt5.Packet]:
        """Yield the packets that replace the filters; common ones stay subscribed, so nothing is missed."""
        before, self._filters = self._filters, filters
        yield from self._subscribe((each, qos) for each, qos in filters.items() if each not in before)
        gone = [each for each in before if each not in filters]
        for start in range(0, len(gone), _FILTERS):
            yield mqtt5.UnsubscribePacket(self._next_id(), gone[start : start + _FILTERS])

    def answered(self, packet: mqtt5.SubAckPacket) -> list[str] | None:
        """Handle SUBACK: return the refused filters as sentences, None if nothing was requested."""
        patterns = self._requested.pop(packet.packet_id, [])
        if len(patterns) != len(packet.reason_codes):
            return None
        return [
            f"the broker refuses the subscription {pattern} ({code.name})"
            for pattern, code in zip(patterns, packet.reason_codes, strict=True)
            if int(code) >= 0x80
        ]

    def _subscribe(self, filters: Iterable[tuple[str, int]]) -> Iterator[mqtt5.Packet]:
        """Yield SUBSCRIBE packets with No Local: our own messages must not come back as requests."""
        wanted = [
            mqtt5.TopicFilter(pattern, max_qos=mqtt5.QoS(qos), no_local=True, retain_as_published=False)
            for pattern, qos in filters
        ]
        for start in range(0, len(wanted), _FILTERS):
            identifier, some = self._next_id(), wanted[start : start + _FILTERS]
            self._requested[identifier] = [each.pattern for each in some]
            yield mqtt5.SubscribePacket(identifier, some)
