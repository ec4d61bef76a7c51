"""Core of the broker, without sockets: admits clients, routes their messages, keeps sessions and wills."""

from __future__ import annotations

import asyncio
import logging
import uuid
from collections.abc import Callable
from typing import Protocol

import mqtt5

from fleet.clock import Clock
from fleet.cloud.topics import matches
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.session import NEVER, BrokerSession, BrokerSubscription, QueuedCopy
from fleet.sim.broker.subscription_directory import RetainedMessage, SubscriptionDirectory

logger = logging.getLogger(__name__)

Check = Callable[[str | None, bytes | None], bool]
"""Returns whether a user name and password are accepted."""


class BrokerPeer(Protocol):
    """Interface of a client's connection to the hub."""

    def flush(self) -> None:
        """Write the waiting messages of the client's session."""

    def disconnect_client(self, reason: mqtt5.DisconnectReasonCode) -> None:
        """End the connection with a reason."""


class BrokerCore:
    """State of one broker; used on one event loop only."""

    def __init__(
        self,
        clock: Clock,
        limits: ClientLimits,
        faults: BrokerFaults,
        check: Check | None,
        *,
        tells_unheard: bool = True,
    ) -> None:
        self.clock = clock
        self.limits = limits
        self.faults = faults
        self.peers: dict[str, BrokerPeer] = {}
        self._check = check
        self._tells_unheard = tells_unheard
        self._directory = SubscriptionDirectory(limits)
        self._behind: set[BrokerPeer] = set()
        self._wills: dict[str, asyncio.TimerHandle] = {}

    def refusal(self, packet: mqtt5.ConnectPacket) -> mqtt5.ConnAckReasonCode | None:
        """Return the reason to refuse a client, None if it is accepted."""
        if self.faults.refuse is not None:
            return mqtt5.ConnAckReasonCode(self.faults.refuse)
        if packet.authentication_method is not None:
            return mqtt5.ConnAckReasonCode.BAD_AUTHENTICATION_METHOD
        if self._check and not self._check(packet.username, packet.password):
            return mqtt5.ConnAckReasonCode.BAD_USER_NAME_OR_PASSWORD
        if packet.client_id not in self._directory.sessions and self._is_full():
            return mqtt5.ConnAckReasonCode.QUOTA_EXCEEDED
        return None

    def admit(self, packet: mqtt5.ConnectPacket, peer: BrokerPeer) -> tuple[BrokerSession, bool]:
        """Admit a client, replacing its older connection; return its session and whether it existed."""
        client_id = packet.client_id or f"auto-{uuid.uuid4().hex}"
        if older := self.peers.get(client_id):
            older.disconnect_client(mqtt5.DisconnectReasonCode.SESSION_TAKEN_OVER)
        if will := self._wills.pop(client_id, None):
            will.cancel()
        self.expire()
        session = None if packet.clean_start else self._directory.sessions.get(client_id)
        present = session is not None
        if session is None:
            session = BrokerSession(client_id, self.limits)
            self._directory.add(session)
        session.expiry, session.ends = packet.session_expiry_interval, None
        session.window = min(packet.receive_max, self.limits.receive)
        self.peers[client_id] = peer
        return session, present

    def leave(self, session: BrokerSession, will: mqtt5.Will | None) -> None:
        """Handle the end of a client's connection; its will, if any, is published now or after its delay."""
        self._behind.discard(self.peers.pop(session.client_id))
        session.ends = None if session.expiry == NEVER else self.clock.monotonic() + session.expiry
        delay = min(will.will_delay_interval, session.expiry) if will else 0
        if will and delay:
            loop = asyncio.get_running_loop()
            self._wills[session.client_id] = loop.call_later(delay, self._publish_will, will, session)
        elif will:
            self._publish_will(will, session)
        self.expire()

    def expire(self) -> None:
        """Remove expired sessions."""
        now = self.clock.monotonic()
        for session in list(self._directory.sessions.values()):
            if session.ends is not None and session.ends <= now:
                self._directory.remove(session)

    def publish(self, packet: mqtt5.PublishPacket, publisher: BrokerSession) -> bool:
        """Route a message; return False if it has no subscriber and publishers are informed of that."""
        if self.faults.drop and matches(self.faults.drop, packet.topic):
            return True
        lifetime = packet.message_expiry_interval
        kept = RetainedMessage(packet, None if lifetime is None else self.clock.monotonic() + lifetime)
        if packet.retain:
            self._directory.retain(kept)
        receivers = [
            (session, heard)
            for session, wanted in self._directory.match(packet.topic)
            if (heard := [one for one in wanted if not (one.options.no_local and session is publisher)])
        ]
        if self.faults.delay:
            asyncio.get_running_loop().call_later(self.faults.delay, self._deliver_all, kept, receivers)
        else:
            self._deliver_all(kept, receivers)
        return bool(receivers) or not self._tells_unheard

    def subscribe(self, session: BrokerSession, subscription: BrokerSubscription) -> None:
        """Add a subscription and queue the retained messages that it requests."""
        options = subscription.options
        new = self._directory.subscribe(session, subscription)
        handling = int(options.retain_handling)
        if handling == mqtt5.RetainHandling.SEND_NEVER or (handling and not new):
            return
        for kept in self._directory.retained(options.pattern, self.clock.monotonic()):
            self._offer(session, _copy(kept, [subscription], retain=True))

    def unsubscribe(self, session: BrokerSession, pattern: str) -> bool:
        """Remove a subscription; return True if there was one."""
        return self._directory.unsubscribe(session, pattern)

    def close(self) -> None:
        """Cancel the delayed wills."""
        for will in self._wills.values():
            will.cancel()

    def _is_full(self) -> bool:
        """Return True if there is no room for a new session, after removing expired ones."""
        self.expire()
        return len(self._directory.sessions) >= self.limits.sessions

    def _deliver_all(
        self, kept: RetainedMessage, receivers: list[tuple[BrokerSession, list[BrokerSubscription]]]
    ) -> None:
        """Deliver one message to all its receivers."""
        times = 2 if self.faults.duplicate and matches(self.faults.duplicate, kept.packet.topic) else 1
        for session, wanted in receivers:
            as_published = any(one.options.retain_as_published for one in wanted)
            for _ in range(times):
                self._offer(session, _copy(kept, wanted, retain=kept.packet.retain and as_published))

    def _offer(self, session: BrokerSession, copy: QueuedCopy) -> None:
        """Queue a message for a client; for an absent one without room, drop its oldest message."""
        peer = self.peers.get(session.client_id)
        if peer:
            self._offer_to(peer, session, copy)
        elif copy.qos:
            session.offer_dropping_oldest(copy)

    def _offer_to(self, peer: BrokerPeer, session: BrokerSession, copy: QueuedCopy) -> None:
        """Queue a message for a connected client; expel the client if it is too slow.

        The messages of one iteration of the event loop are written together.
        """
        if not session.offer(copy):
            peer.flush()
            if not session.offer(copy):
                logger.warning("the client %s is too slow", session.client_id)
                peer.disconnect_client(mqtt5.DisconnectReasonCode.QUOTA_EXCEEDED)
                return
        if not self._behind:
            asyncio.get_running_loop().call_soon(self._flush)
        self._behind.add(peer)

    def _flush(self) -> None:
        """Write the waiting messages of each client."""
        behind, self._behind = self._behind, set()
        for peer in behind:
            peer.flush()

    def _publish_will(self, will: mqtt5.Will, session: BrokerSession) -> None:
        """Publish a client's will."""
        self._wills.pop(session.client_id, None)
        packet = mqtt5.PublishPacket(
            will.topic,
            will.payload or b"",
            qos=will.qos,
            packet_id=1 if int(will.qos) else None,
            retain=will.retain,
            payload_format_indicator=will.payload_format_indicator,
            message_expiry_interval=will.message_expiry_interval,
            content_type=will.content_type,
            response_topic=will.response_topic,
            correlation_data=will.correlation_data,
            user_properties=will.user_properties,
        )
        self.publish(packet, session)


def _copy(kept: RetainedMessage, wanted: list[BrokerSubscription], *, retain: bool) -> QueuedCopy:
    """Return one client's copy: its highest subscribed QoS, at most the published one."""
    best = max(int(one.options.max_qos) for one in wanted)
    return QueuedCopy(
        packet=kept.packet,
        qos=min(best, int(kept.packet.qos)),
        retain=retain,
        identifiers=[one.identifier for one in wanted if one.identifier is not None],
        deadline=kept.deadline,
    )
