"""A bare MQTT 5 client: its own cost is next to nothing, so that it hides no difference between two sides."""

import socket
import threading
import time

import mqtt5

from fleet.cloud.packets import Decoder

LARGEST = 1 << 20


class Mqtt:
    """One connection. What is subscribed to is read on a thread of its own and handed to ``took``.

    ``took(topic, payload, now)``; ``acked`` counts the QoS 1 messages that the broker has.
    """

    def __init__(self, port, name, *, topics=(), took=None, qos=1):
        self.acked = 0
        self._took = took
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lock = threading.Lock()
        self._last = 0
        self._write(mqtt5.ConnectPacket(name, clean_start=True, keep_alive=0, receive_max=65535))
        if topics:
            self._write(
                mqtt5.SubscribePacket(1, [mqtt5.TopicFilter(each, max_qos=mqtt5.QoS(qos)) for each in topics])
            )
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._wanted = mqtt5.SubAckPacket if topics else mqtt5.ConnAckPacket
        self._thread.start()
        if not self._ready.wait(20):
            raise RuntimeError("the broker does not let the benchmark in")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()

    def packet(self, topic, payload, qos=0, **options):
        """The bytes of a message."""
        identifier = None
        if qos:
            self._last = identifier = self._last % 0xFFFF + 1
        return mqtt5.PublishPacket(
            topic, payload, qos=mqtt5.QoS(qos), packet_id=identifier, **options
        ).write()

    def publish(self, topic, payload, qos=0, **options):
        """Publish at once."""
        self.send(self.packet(topic, payload, qos, **options))

    def send(self, data):
        """Write what ``packet`` made, one or many."""
        with self._lock:
            self._socket.sendall(data)

    def _write(self, packet):
        self.send(packet.write())

    def _read(self):
        decoder = Decoder(5, LARGEST)
        try:
            while data := self._socket.recv(65536):
                now = time.monotonic()
                answers = [answer for packet in decoder.feed(data) if (answer := self._handle(packet, now))]
                if answers:
                    self.send(b"".join(answers))
        except OSError:
            return

    def _handle(self, packet, now):
        """Take a packet; return the bytes that acknowledge it."""
        if isinstance(packet, mqtt5.PublishPacket):
            if self._took:
                self._took(packet.topic, packet.payload, now)
            return mqtt5.PubAckPacket(packet.packet_id).write() if packet.packet_id else b""
        if isinstance(packet, self._wanted):
            self._ready.set()
        self.acked += isinstance(packet, mqtt5.PubAckPacket)
        return b""
