"""Routing tables of the broker: sessions by client, matches by topic, and retained messages."""

from __future__ import annotations

import mqtt5
import msgspec

from fleet.cloud.topics import matches
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.session import BrokerSession, BrokerSubscription

_REMEMBERED = 10_000
"""Maximum number of topics whose matches are cached."""


class RetainedMessage(msgspec.Struct, frozen=True):
    """A message with its expiry time, monotonic seconds; None: it does not expire."""

    packet: mqtt5.PublishPacket
    deadline: float | None


class SubscriptionDirectory:
    """Routing tables of the broker; no I/O, no clock."""

    def __init__(self, limits: ClientLimits) -> None:
        self.sessions: dict[str, BrokerSession] = {}
        self._limits = limits
        self._retained_bytes = 0
        self._retained: dict[str, RetainedMessage] = {}
        self._matches: dict[str, list[tuple[BrokerSession, list[BrokerSubscription]]]] = {}

    def add(self, session: BrokerSession) -> None:
        """Add a session, in place of an older one of the same client."""
        self.sessions[session.client_id] = session
        self._matches.clear()

    def remove(self, session: BrokerSession) -> None:
        """Remove a session."""
        self.sessions.pop(session.client_id, None)
        self._matches.clear()

    def subscribe(self, session: BrokerSession, subscription: BrokerSubscription) -> bool:
        """Add a subscription or replace the one with the same filter; return True if it is new."""
        pattern = subscription.options.pattern
        new = pattern not in session.subscriptions
        session.subscriptions[pattern] = subscription
        self._matches.clear()
        return new

    def unsubscribe(self, session: BrokerSession, pattern: str) -> bool:
        """Remove a subscription; return True if there was one."""
        self._matches.clear()
        return session.subscriptions.pop(pattern, None) is not None

    def match(self, topic: str) -> list[tuple[BrokerSession, list[BrokerSubscription]]]:
        """Return the sessions that subscribe to a topic, each with its matching subscriptions."""
        if (known := self._matches.get(topic)) is not None:
            return known
        found = []
        for session in self.sessions.values():
            wanted = [one for pattern, one in session.subscriptions.items() if matches(pattern, topic)]
            if wanted:
                found.append((session, wanted))
        if len(self._matches) >= _REMEMBERED:
            self._matches.clear()
        self._matches[topic] = found
        return found

    def retain(self, kept: RetainedMessage) -> None:
        """Store a retained message; an empty one clears the topic, a full store accepts no new topic."""
        topic, size = kept.packet.topic, len(kept.packet.payload)
        if older := self._retained.pop(topic, None):
            self._retained_bytes -= len(older.packet.payload)
        room = self._retained_bytes + size <= self._limits.retained_bytes
        if size and room and len(self._retained) < self._limits.retained:
            self._retained[topic] = kept
            self._retained_bytes += size

    def retained(self, pattern: str, now: float) -> list[RetainedMessage]:
        """Return the retained messages that match a filter and have not expired."""
        return [
            kept
            for topic, kept in self._retained.items()
            if matches(pattern, topic) and (kept.deadline is None or kept.deadline > now)
        ]
