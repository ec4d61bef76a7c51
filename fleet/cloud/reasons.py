"""MQTT reason codes as sentences for the user (MQTT 5, section 2.4)."""

from __future__ import annotations

import mqtt5

_SENTENCES = {
    0x84: "the broker does not speak this protocol version; set the other one (5 or 311)",
    0x85: "the broker does not accept the client id",
    0x86: "the broker does not accept the user name or password; check cloud.token or cloud.password",
    0x87: "the broker does not allow this client; check cloud.token or cloud.password, and its permissions",
    0x88: "the broker is not available",
    0x89: "the broker is busy",
    0x8A: "the broker has banned this client",
    0x8B: "the broker is shutting down",
    0x8C: "the broker wants another way to authenticate",
    0x8D: "the broker received nothing from us in time",
    0x8E: "another client uses the same client id; give each edge its own",
    0x93: "the broker reports too many messages in flight",
    0x95: "the broker reports that a packet was too large",
    0x96: "the broker reports that messages arrive too fast",
    0x97: "the broker's quota is used up",
    0x98: "the broker's administrator closed the connection",
    0x9C: "the broker asks to use another server",
    0x9D: "the broker has moved to another server",
    0x9F: "the broker reports that we connect too often",
}

_PERMANENT = frozenset({0x84, 0x85, 0x86, 0x87, 0x8A, 0x8C, 0x8E, 0x97, 0x98, 0x9C, 0x9D, 0x9F})
"""Reasons of a DISCONNECT for which an immediate reconnect is no cure."""


def sentence(code: int, reason: str | None = None, server: str | None = None) -> str:
    """Return one line that explains the code, with the broker's own words if it sent any."""
    text = _SENTENCES.get(code, f"the broker gave the reason 0x{code:02x}")
    extras = [extra for extra in (reason, server and f"server {server}") if extra]
    return f"{text} ({'; '.join(extras)})" if extras else text


def of(packet: mqtt5.ConnAckPacket | mqtt5.DisconnectPacket) -> str:
    """Return one line that says why the broker refused or closed the connection."""
    return sentence(int(packet.reason_code), packet.reason_str, packet.server_reference)


def is_permanent(code: int) -> bool:
    """Return whether the reason of a DISCONNECT will still hold in a second, so that haste only harms."""
    return code in _PERMANENT
