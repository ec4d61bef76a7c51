"""Whatever a client sends, the worst that happens is the end of its own connection."""

import asyncio

import mqtt5
from hypothesis import given
from hypothesis import strategies as st

from fleet.sim.broker.broker_core import BrokerCore
from fleet.sim.broker.connection import BrokerConnection
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.testing.clock import ManualClock

topics = st.sampled_from(["a", "a/b", "$a", "/"])
identifiers = st.integers(1, 3)
qualities = st.integers(0, 2).map(mqtt5.QoS)
filters = st.builds(
    mqtt5.TopicFilter,
    st.sampled_from(["a", "#", "+/b", "$share/g/a"]),
    max_qos=qualities,
    no_local=st.booleans(),
)


def publish(topic, payload, qos, identifier, **more):
    return mqtt5.PublishPacket(topic, payload, qos=qos, packet_id=identifier if int(qos) else None, **more)


packets = st.one_of(
    st.builds(
        publish,
        topics,
        st.binary(max_size=3),
        qualities,
        identifiers,
        retain=st.booleans(),
        duplicate=st.booleans(),
        message_expiry_interval=st.none() | st.integers(0, 2),
    ),
    st.builds(mqtt5.SubscribePacket, identifiers, st.lists(filters, min_size=1, max_size=2)),
    st.builds(mqtt5.UnsubscribePacket, identifiers, st.lists(topics, min_size=1, max_size=2)),
    *[
        st.builds(kind, identifiers)
        for kind in (mqtt5.PubAckPacket, mqtt5.PubRecPacket, mqtt5.PubRelPacket, mqtt5.PubCompPacket)
    ],
    st.just(mqtt5.PingReqPacket()),
    st.builds(mqtt5.DisconnectPacket, session_expiry_interval=st.none() | st.integers(0, 9)),
    st.just(mqtt5.ConnectPacket("mallory", session_expiry_interval=9)),
    st.just(mqtt5.AuthPacket()),
)
noise = st.lists(packets.map(lambda packet: packet.write()) | st.binary(min_size=1, max_size=4), max_size=12)


class Wire(asyncio.Transport):
    """Takes what the broker writes."""

    def __init__(self):
        super().__init__()
        self.written = b""
        self.closed = False
        self.reading = True

    def write(self, data):
        assert not self.closed
        self.written += data

    def close(self):
        self.closed = True

    abort = close

    def pause_reading(self):
        self.reading = False

    def resume_reading(self):
        self.reading = True


@given(noise)
def test_no_packets_in_no_order_disturb_the_broker(pieces):
    asyncio.run(meets_noise(pieces))


async def meets_noise(pieces):
    hub = BrokerCore(ManualClock(), ClientLimits(), BrokerFaults(), None)
    mallory, bob = joined(hub, "mallory", Wire()), joined(hub, "bob", wire := Wire())
    mallory.data_received(b"".join(pieces))
    await asyncio.sleep(0)
    mallory.connection_lost(None)
    wire.written = b""
    bob.data_received(mqtt5.PingReqPacket().write())
    assert wire.written == mqtt5.PingRespPacket().write()
    assert "mallory" not in hub.peers


def joined(hub, name, wire):
    connection = BrokerConnection(hub, set())
    connection.connection_made(wire)
    connection.data_received(mqtt5.ConnectPacket(name, clean_start=True, keep_alive=10).write())
    return connection


def test_a_silent_client_is_disconnected_and_then_cut_off():
    hub = BrokerCore(clock := ManualClock(), ClientLimits(), BrokerFaults(), None)
    connection = joined(hub, "bob", wire := Wire())
    clock.advance(14)
    connection.watch()
    assert hub.peers
    clock.advance(2)
    connection.watch()
    assert not hub.peers
    assert wire.written.endswith(
        mqtt5.DisconnectPacket(reason_code=mqtt5.DisconnectReasonCode.KEEP_ALIVE_TIMEOUT).write()
    )


def test_a_client_that_does_not_read_is_not_listened_to():
    connection = joined(
        BrokerCore(ManualClock(), ClientLimits(), BrokerFaults(), None), "bob", wire := Wire()
    )
    connection.pause_writing()
    assert not wire.reading
    connection.resume_writing()
    assert wire.reading


def test_the_time_of_a_freeze_is_not_the_silence_of_the_client():
    hub = BrokerCore(clock := ManualClock(), ClientLimits(), faults := BrokerFaults(), None)
    connection = joined(hub, "bob", wire := Wire())
    faults.freeze, wire.written = True, b""
    connection.watch()
    connection.data_received(mqtt5.PingReqPacket().write())
    clock.advance(100)
    assert (wire.written, wire.reading) == (b"", False)
    faults.freeze = False
    connection.watch()
    assert wire.written == mqtt5.PingRespPacket().write()
    assert wire.reading
    assert hub.peers
