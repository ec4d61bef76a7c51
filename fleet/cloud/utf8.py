"""Finds text that is not UTF-8 in an MQTT 5 packet (sections 2.2.2 and 3) before the codec decodes it; pure.

The codec panics on such text, and the panic prints a page on stderr even when it is caught. A malformed
packet ends the search: the codec refuses it with a normal error.
"""

from __future__ import annotations

from collections.abc import Mapping

_SIZES: Mapping[int, int] = {
    **dict.fromkeys((0x01, 0x17, 0x19, 0x24, 0x25, 0x28, 0x29, 0x2A), 1),
    **dict.fromkeys((0x13, 0x21, 0x22, 0x23), 2),
    **dict.fromkeys((0x02, 0x11, 0x18, 0x27), 4),
}
"""Sizes, in bytes, of the properties of fixed size, by identifier."""
_TEXTS = frozenset({0x03, 0x08, 0x12, 0x15, 0x1A, 0x1C, 0x1F})
_BINARIES = frozenset({0x09, 0x16})
_NUMBER = 0x0B  # a variable byte integer
_PAIR = 0x26
_LAYOUTS: Mapping[int, str] = {
    1: "s4pw",
    2: "2p",
    3: "sip",
    4: "21p",
    5: "21p",
    6: "21p",
    7: "21p",
    8: "2p*",
    9: "2p",
    10: "2p*",
    11: "2p",
    14: "1p",
    15: "1p",
}
"""Layout behind the remaining length, by packet type.

s: a string; a digit: so many bytes; i: the packet identifier of QoS 1 and 2; p: properties; w: the rest of a
CONNECT behind its properties; ``*``: filters to the end, each with an options byte in a SUBSCRIBE.
"""
_SUBSCRIBE = 8
_SHORTEST_TEXT = 5  # bytes of a packet with one: type, length, two bytes of the text's length, a character
_QOS = 0x06
_HAS_WILL, _HAS_USER = 0x04, 0x80


class _NotUtf8(Exception):
    """A string of the packet is not UTF-8."""


class _Scanner:
    """Scans one packet; raises _NotUtf8, and IndexError for a malformed packet."""

    def __init__(self, packet: memoryview) -> None:
        self._packet = packet
        self._at = 1
        self.number()  # skip the remaining length: the packet is complete

    def packet(self) -> None:
        """Scan the whole packet."""
        kind, flags = self._packet[0] >> 4, self._packet[0]
        for part in _LAYOUTS.get(kind, ""):
            match part:
                case "s":
                    self.text()
                case "p":
                    self.properties()
                case "i":
                    self.skip(2 if flags & _QOS else 0)
                case "w":
                    self.rest_of_connect()
                case "*":
                    self.filters(options=kind == _SUBSCRIBE)
                case _:
                    self.skip(int(part))

    def skip(self, size: int) -> None:
        """Skip bytes."""
        self._at += size
        if self._at > len(self._packet):
            raise IndexError

    def number(self) -> int:
        """Read a variable byte integer."""
        value = shift = 0
        while True:
            byte = self._packet[self._at]
            self._at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value
            if shift == 28:
                raise IndexError

    def binary(self) -> bytes:
        """Read binary data with its length."""
        start = self._at + 2
        size = self._packet[self._at] << 8 | self._packet[self._at + 1]
        self.skip(2 + size)
        return bytes(self._packet[start : start + size])

    def text(self) -> None:
        """Read a string."""
        try:
            self.binary().decode()
        except UnicodeDecodeError:
            raise _NotUtf8 from None

    def properties(self) -> None:
        """Read properties with their length."""
        size = self.number()
        end = self._at + size
        while self._at < end:
            self._property(self.number())

    def _property(self, identifier: int) -> None:
        """Read one property."""
        if identifier in _TEXTS:
            self.text()
        elif identifier == _PAIR:
            self.text()
            self.text()
        elif identifier in _BINARIES:
            self.binary()
        elif identifier == _NUMBER:
            self.number()
        else:
            self.skip(_SIZES.get(identifier, len(self._packet)))

    def rest_of_connect(self) -> None:
        """Read client id, will and user name of a CONNECT; ``_at`` is behind its properties."""
        flags = self._packet[8 + self._length_bytes()]  # offset: type, length, name (6), version
        self.text()
        if flags & _HAS_WILL:
            self.properties()
            self.text()
            self.binary()
        if flags & _HAS_USER:
            self.text()

    def _length_bytes(self) -> int:
        """Return the size of the packet's length field."""
        return next(size for size in range(1, 5) if self._packet[size] < 0x80)

    def filters(self, *, options: bool) -> None:
        """Read filters to the end."""
        while self._at < len(self._packet):
            self.text()
            self.skip(1 if options else 0)


def has_broken_text(packet: memoryview) -> bool:
    """Return whether a string in a complete MQTT 5 packet is not UTF-8; False if it is malformed before.

    A packet of ASCII characters behind its first two bytes has no broken text. A length field of three bytes
    or more, which is not ASCII either, is that of a long packet, which is scanned. Neither has the usual
    acknowledgement: its four bytes end with the packet identifier.
    """
    if len(packet) < _SHORTEST_TEXT or bytes(packet[2:]).isascii():
        return False
    try:
        _Scanner(packet).packet()
    except _NotUtf8:
        return True
    except IndexError:
        pass
    return False
