"""MQTT 3.1.1 encoding of the MQTT 5 codec's packet objects (OASIS MQTT 3.1.1, section 3).

Fields that 3.1.1 does not have are left out: properties, reason codes, subscription options. A persistent
session (clean session 0) is one that never expires. Decoding is strict: a violation of the standard raises
ValueError, and so does the end of the data inside a packet.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mqtt5

from fleet.cloud.fields import binary, length, text

NEVER = 0xFFFF_FFFF
"""MQTT 5's session expiry of a session that never expires."""

_REASONS = {
    0: mqtt5.ConnAckReasonCode.SUCCESS,
    1: mqtt5.ConnAckReasonCode.UNSUPPORTED_PROTOCOL_VERSION,
    2: mqtt5.ConnAckReasonCode.CLIENT_ID_NOT_VALID,
    3: mqtt5.ConnAckReasonCode.SERVER_UNAVAILABLE,
    4: mqtt5.ConnAckReasonCode.BAD_USER_NAME_OR_PASSWORD,
    5: mqtt5.ConnAckReasonCode.NOT_AUTHORIZED,
}
_CODES = {int(reason): code for code, reason in _REASONS.items()}
_FAILURE = 0x80


class _Fields:
    """Reader of the fields of one packet body, in order."""

    def __init__(self, body: memoryview) -> None:
        self._body = body
        self._at = 0

    def read(self, count: int) -> bytes:
        """Return the next bytes; raise ValueError if there are fewer."""
        end = self._at + count
        if end > len(self._body):
            raise ValueError("the packet ends inside a field")
        piece = bytes(self._body[self._at : end])
        self._at = end
        return piece

    def byte(self) -> int:
        """Return the next byte."""
        return self.read(1)[0]

    def number(self) -> int:
        """Return a two-byte integer, big-endian."""
        return int.from_bytes(self.read(2))

    def identifier(self) -> int:
        """Return a packet identifier, which is never zero."""
        if not (value := self.number()):
            raise ValueError("a packet identifier is 0")
        return value

    def binary(self) -> bytes:
        """Return binary data behind its length."""
        return self.read(self.number())

    def text(self) -> str:
        """Return a UTF-8 string without NUL."""
        value = self.binary().decode()
        if "\0" in value:
            raise ValueError("a text holds a NUL")
        return value

    def left(self) -> bool:
        """Return whether bytes are left."""
        return self._at < len(self._body)

    def rest(self) -> bytes:
        """Return the remaining bytes."""
        return self.read(len(self._body) - self._at)


def read(frame: memoryview) -> mqtt5.Packet:
    """Decode one complete frame; raise ValueError if it is invalid."""
    kind, flags = frame[0] >> 4, frame[0] & 0x0F
    start = 1
    while frame[start] & 0x80:
        start += 1
    fields = _Fields(frame[start + 1 :])
    if kind == 3:
        return _read_publish(fields, flags)
    if kind not in _READERS:
        raise ValueError(f"packet type {kind} does not exist in MQTT 3.1.1")
    wanted, reader = _READERS[kind]
    if flags != wanted:
        raise ValueError(f"packet type {kind} has the flags {flags}")
    packet = reader(fields)
    if fields.left():
        raise ValueError(f"packet type {kind} has bytes after its end")
    return packet


def write(packet: mqtt5.Packet) -> bytes:
    """Return the frame of a packet; raise ValueError for a packet that 3.1.1 does not have."""
    writer = _WRITERS.get(type(packet))
    if writer is None:
        raise ValueError(f"MQTT 3.1.1 has no {type(packet).__name__}")
    first, body = writer(packet)
    return bytes([first]) + length(len(body)) + body


def _read_connect(fields: _Fields) -> mqtt5.Packet:
    """CONNECT: client id, will, user name and password."""
    if fields.binary() != b"MQTT" or fields.byte() != 4:
        raise ValueError("the client does not speak MQTT 3.1.1")
    flags = fields.byte()
    keep_alive, client_id = fields.number(), fields.text()
    if flags & 0x01 or (not flags & 0x04 and flags & 0x38) or (flags & 0x40 and not flags & 0x80):
        raise ValueError(f"the connect flags {flags:#04x} contradict each other")
    clean = bool(flags & 0x02)
    return mqtt5.ConnectPacket(
        client_id,
        clean_start=clean,
        session_expiry_interval=0 if clean else NEVER,
        keep_alive=keep_alive,
        will=_read_will(fields, flags) if flags & 0x04 else None,
        username=fields.text() if flags & 0x80 else None,
        password=fields.binary() if flags & 0x40 else None,
    )


def _read_will(fields: _Fields, flags: int) -> mqtt5.Will:
    """Return the will: topic and payload, with QoS and retain from the connect flags."""
    return mqtt5.Will(
        fields.text(),
        payload=fields.binary(),
        qos=mqtt5.QoS(flags >> 3 & 0x03),
        retain=bool(flags & 0x20),
    )


def _read_connack(fields: _Fields) -> mqtt5.Packet:
    """CONNACK: session present, return code."""
    present, code = fields.byte(), fields.byte()
    if present > 1 or code not in _REASONS:
        raise ValueError(f"the answer to CONNECT is {present}, {code}")
    return mqtt5.ConnAckPacket(session_present=bool(present), reason_code=_REASONS[code])


def _read_publish(fields: _Fields, flags: int) -> mqtt5.Packet:
    """PUBLISH: topic, identifier for QoS 1 and 2, payload."""
    qos = flags >> 1 & 0x03
    topic = fields.text()
    if not topic or (flags & 0x08 and not qos):
        raise ValueError("a message has no topic, or says it is a duplicate at QoS 0")
    identifier = fields.identifier() if qos else None
    return mqtt5.PublishPacket(
        topic,
        fields.rest(),
        qos=mqtt5.QoS(qos),
        retain=bool(flags & 0x01),
        duplicate=bool(flags & 0x08),
        packet_id=identifier,
    )


def _read_subscribe(fields: _Fields) -> mqtt5.Packet:
    """SUBSCRIBE: identifier, then pairs of filter and QoS."""
    identifier = fields.identifier()
    filters = []
    while fields.left():
        filters.append(
            mqtt5.TopicFilter(_pattern(fields), max_qos=mqtt5.QoS(fields.byte()), retain_as_published=False)
        )
    return mqtt5.SubscribePacket(identifier, filters)


def _read_suback(fields: _Fields) -> mqtt5.Packet:
    """SUBACK: identifier, then a granted QoS or a failure for each filter."""
    identifier = fields.identifier()
    codes = fields.rest()
    if not codes or any(code > 2 and code != _FAILURE for code in codes):
        raise ValueError("the answer to SUBSCRIBE has an unknown code or none")
    return mqtt5.SubAckPacket(identifier, [mqtt5.SubAckReasonCode(code) for code in codes])


def _read_unsubscribe(fields: _Fields) -> mqtt5.Packet:
    """UNSUBSCRIBE: identifier, then filters."""
    identifier = fields.identifier()
    patterns = []
    while fields.left():
        patterns.append(_pattern(fields))
    if not patterns:
        raise ValueError("UNSUBSCRIBE names no filter")
    return mqtt5.UnsubscribePacket(identifier, patterns)


def _pattern(fields: _Fields) -> str:
    """Return a filter, which is never empty."""
    if not (pattern := fields.text()):
        raise ValueError("a filter is empty")
    return pattern


def _write_connect(packet: Any) -> tuple[int, bytes]:
    """CONNECT; a session that must persist is requested with clean session 0."""
    will = packet.will
    flags = 0x02 if packet.clean_start and not packet.session_expiry_interval else 0
    body = packet.keep_alive.to_bytes(2) + text(packet.client_id)
    if will is not None:
        flags |= 0x04 | int(will.qos) << 3 | will.retain << 5
        body += text(will.topic) + binary(will.payload or b"")
    if packet.username is not None:
        flags |= 0x80
        body += text(packet.username)
    if packet.password is not None:
        if packet.username is None:
            raise ValueError("MQTT 3.1.1 has no password without a user name")
        flags |= 0x40
        body += binary(packet.password)
    return 0x10, text("MQTT") + bytes([4, flags]) + body


def _write_connack(packet: Any) -> tuple[int, bytes]:
    """CONNACK; a reason that 3.1.1 does not have becomes "server unavailable"."""
    code = _CODES.get(int(packet.reason_code), 3)
    return 0x20, bytes([packet.session_present and not code, code])


def _write_publish(packet: Any) -> tuple[int, bytes]:
    """PUBLISH."""
    head = packet.packet_id.to_bytes(2) if int(packet.qos) else b""
    first = 0x30 | packet.duplicate << 3 | int(packet.qos) << 1 | packet.retain
    return first, text(packet.topic) + head + packet.payload


def _write_subscribe(packet: Any) -> tuple[int, bytes]:
    """SUBSCRIBE."""
    pieces = [text(one.pattern) + bytes([int(one.max_qos)]) for one in packet.topic_filters]
    return 0x82, packet.packet_id.to_bytes(2) + b"".join(pieces)


def _write_suback(packet: Any) -> tuple[int, bytes]:
    """SUBACK; 3.1.1 has one failure code."""
    return 0x90, packet.packet_id.to_bytes(2) + bytes(
        min(int(code), _FAILURE) for code in packet.reason_codes
    )


def _write_unsubscribe(packet: Any) -> tuple[int, bytes]:
    """UNSUBSCRIBE."""
    return 0xA2, packet.packet_id.to_bytes(2) + b"".join(text(pattern) for pattern in packet.patterns)


def _numbered(kind: Callable[[int], mqtt5.Packet]) -> Callable[[_Fields], mqtt5.Packet]:
    """Return the decoder of a packet that has only an identifier."""
    return lambda fields: kind(fields.identifier())


def _write_number(first: int) -> Callable[[Any], tuple[int, bytes]]:
    """Return the encoder of a packet that has only an identifier."""
    return lambda packet: (first, packet.packet_id.to_bytes(2))


_READERS: dict[int, tuple[int, Callable[[_Fields], mqtt5.Packet]]] = {
    1: (0, _read_connect),
    2: (0, _read_connack),
    4: (0, _numbered(mqtt5.PubAckPacket)),
    5: (0, _numbered(mqtt5.PubRecPacket)),
    6: (2, _numbered(mqtt5.PubRelPacket)),
    7: (0, _numbered(mqtt5.PubCompPacket)),
    8: (2, _read_subscribe),
    9: (0, _read_suback),
    10: (2, _read_unsubscribe),
    11: (0, _numbered(lambda identifier: mqtt5.UnsubAckPacket(identifier, []))),
    12: (0, lambda _: mqtt5.PingReqPacket()),
    13: (0, lambda _: mqtt5.PingRespPacket()),
    14: (0, lambda _: mqtt5.DisconnectPacket()),
}
"""By packet type: the flags that the standard requires, and the decoder of the body.

PUBLISH has its own flags.
"""

_WRITERS: dict[type, Callable[[object], tuple[int, bytes]]] = {
    mqtt5.ConnectPacket: _write_connect,
    mqtt5.ConnAckPacket: _write_connack,
    mqtt5.PublishPacket: _write_publish,
    mqtt5.PubAckPacket: _write_number(0x40),
    mqtt5.PubRecPacket: _write_number(0x50),
    mqtt5.PubRelPacket: _write_number(0x62),
    mqtt5.PubCompPacket: _write_number(0x70),
    mqtt5.SubscribePacket: _write_subscribe,
    mqtt5.SubAckPacket: _write_suback,
    mqtt5.UnsubscribePacket: _write_unsubscribe,
    mqtt5.UnsubAckPacket: _write_number(0xB0),
    mqtt5.PingReqPacket: lambda _: (0xC0, b""),
    mqtt5.PingRespPacket: lambda _: (0xD0, b""),
    mqtt5.DisconnectPacket: lambda _: (0xE0, b""),
}
"""By packet class: the encoder, which returns first byte and body."""
