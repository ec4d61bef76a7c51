"""Minimal MQTT 5 client of negligible cost, for tests and benchmarks."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any, Self

import mqtt5

from fleet.cloud.packets import PacketDecoder

LARGEST = 1 << 20  # bytes of one packet
WITHIN = 60.0  # s for the broker to let it in

Took = Callable[[mqtt5.PublishPacket, float], None]


class Mqtt:
    """One connection to a broker on this computer. It never connects again by itself.

    What is subscribed to (``topics``) is read on a thread of its own and handed to ``took`` with the
    monotonic second. ``acked`` counts the QoS 1 messages that the broker has taken, ``unheard`` those of them
    to which nobody is subscribed. Raises OSError when the broker is not there or does not answer.
    """

    def __init__(
        self, port: int, name: str, *, topics: Iterable[str] = (), took: Took | None = None, qos: int = 1
    ) -> None:
        self.acked = 0
        self.unheard = 0
        self._took = took
        self._socket = socket.create_connection(("127.0.0.1", port), WITHIN)
        self._socket.settimeout(None)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lock = threading.Lock()
        self._last = 0
        self._ready = threading.Event()
        filters = [mqtt5.TopicFilter(topic, max_qos=mqtt5.QoS(qos)) for topic in topics]
        self._awaited = mqtt5.SubAckPacket if filters else mqtt5.ConnAckPacket
        self.send(mqtt5.ConnectPacket(name, clean_start=True, keep_alive=0, receive_max=0xFFFF).write())
        if filters:
            self.send(mqtt5.SubscribePacket(1, filters).write())
        self._thread = threading.Thread(target=self._read, name="bare-mqtt", daemon=True)
        self._thread.start()
        if not self._ready.wait(WITHIN):
            self.close()
            raise OSError("the broker does not let the bare client in")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """False once the connection has ended."""
        return self._thread.is_alive()

    def close(self) -> None:
        """End the connection."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()

    def packet(self, topic: str, payload: bytes, qos: int = 0, **options: Any) -> bytes:
        """Return the bytes of a message; ``options`` are the codec's (response_topic, correlation_data)."""
        identifier = None
        if qos:
            self._last = identifier = self._last % 0xFFFF + 1
        packet = mqtt5.PublishPacket(topic, payload, qos=mqtt5.QoS(qos), packet_id=identifier, **options)
        return packet.write()

    def publish(self, topic: str, payload: bytes, qos: int = 0, **options: object) -> None:
        """Publish at once."""
        self.send(self.packet(topic, payload, qos, **options))

    def send(self, data: bytes) -> None:
        """Write what ``packet`` made, one or many; raises OSError when the connection has ended."""
        with self._lock:
            self._socket.sendall(data)

    def _read(self) -> None:
        """Take what comes until the connection ends."""
        decoder = PacketDecoder(5, LARGEST)
        with contextlib.suppress(OSError):
            while data := self._socket.recv(65536):
                now = time.monotonic()
                answers = b"".join([self._handle(packet, now) for packet in decoder.feed(data)])
                if answers:
                    self.send(answers)

    def _handle(self, packet: object, now: float) -> bytes:
        """Take a packet; return the bytes that acknowledge it."""
        if isinstance(packet, mqtt5.PublishPacket):
            if self._took is not None:
                self._took(packet, now)
            return mqtt5.PubAckPacket(packet.packet_id).write() if packet.packet_id else b""
        if isinstance(packet, self._awaited):
            self._ready.set()
        if isinstance(packet, mqtt5.PubAckPacket):
            self.acked += 1
            self.unheard += int(packet.reason_code) == int(mqtt5.PubAckReasonCode.NO_MATCHING_SUBSCRIBERS)
        return b""
