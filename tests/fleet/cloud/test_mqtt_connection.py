"""One connection: how long a silent cut goes unnoticed, and who reads while the loop is stuck."""

import asyncio
import gc
import weakref

import mqtt5
import pytest

from fleet.cloud.mqtt_connection import MqttConnection
from fleet.cloud.mqtt_session import MqttSession
from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.packets import PacketDecoder
from fleet.cloud.values import CloudSettings, CloudStats
from fleet.errors import CloudError
from fleet.spool.message import Outgoing
from fleet.spool.queue import NEWEST_FIRST
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock
from fleet.wire.rules import TrafficClass

SILENCE = 8.5  # s; the longest that a cut may go unnoticed
WITHIN = 60.0  # s
SETTINGS = CloudSettings(host="h", client_id="me")


@pytest.fixture
def clock():
    return ManualClock()


class Broker:
    """The other end of a connection, in the test's hands; ``handed`` is what the connection hands over."""

    def __init__(self, end):
        self.end = end
        self.handed = []
        self.taken = asyncio.Event()
        self.begin = lambda: None
        self._decoder = PacketDecoder(None, 10_000)

    def dispatch(self):
        """Be who takes what is handed over."""
        self.taken.set()
        self.begin()

    async def is_taken(self):
        await asyncio.wait_for(self.taken.wait(), WITHIN)
        self.taken.clear()

    def say(self, *packets):
        self.end.sendall(b"".join(packet.write() for packet in packets))

    def hear(self):
        return [type(packet) for packet in self._decoder.feed(self.end.recv(4096))]


@pytest.fixture
async def broker(ends):
    return Broker(ends[1])


@pytest.fixture
def box(clock):
    return OutboundQueue(Spool(SpoolSettings(), clock), 1000, 10**6, CloudStats(), clock)


@pytest.fixture
async def connection(ends, broker, clock, box):
    """Be connected, with the settings that an edge has by itself."""
    session = MqttSession(SETTINGS, {}, box, CloudStats())
    one = MqttConnection(
        ends[0], session, SETTINGS, clock, deliver=broker.handed.extend, dispatch=broker.dispatch
    )
    broker.say(mqtt5.ConnAckPacket())
    await asyncio.wait_for(one.ready, WITHIN)
    broker.taken.clear()
    assert broker.hear() == [mqtt5.ConnectPacket]
    return one


@pytest.fixture
def writes(connection, monkeypatch):
    """Note each write to the network."""
    write, written = connection._stream.write, asyncio.Queue()
    monkeypatch.setattr(connection._stream, "write", lambda data: (written.put_nowait(data), write(data)))
    return written


def send(connection, box, *topics):
    """Queue a message on each topic, with a request to write it soon."""
    for topic in topics:
        box.spool.put(Outgoing(topic, b"", 1, TrafficClass.EVENT))
        connection.spaced(connection.flush)


async def test_the_first_message_after_a_pause_leaves_at_once_and_those_of_a_stream_share_a_write(
    connection, box, writes, clock
):
    box.go_online()
    clock.advance(NEWEST_FIRST)
    send(connection, box, "first")
    assert b"first" in writes.get_nowait()
    send(connection, box, "second", "third")
    assert writes.empty()
    shared = await asyncio.wait_for(writes.get(), WITHIN)
    assert b"second" in shared
    assert b"third" in shared


async def test_a_message_that_may_not_wait_does_not_wait_for_a_planned_write(connection, box, writes, clock):
    box.go_online()
    clock.advance(NEWEST_FIRST)
    send(connection, box, "first", "second")
    writes.get_nowait()
    connection.flush()
    assert b"second" in writes.get_nowait()


@pytest.mark.parametrize("phase", [0.0, 0.01, 0.1, 0.24])
async def test_a_silent_cut_is_noticed_whenever_it_comes_between_two_looks(connection, broker, clock, phase):
    clock.advance(connection.watch_interval - phase)
    broker.say(mqtt5.PublishPacket("t", b"the last that gets through"))
    await broker.is_taken()
    clock.advance(phase)
    silent = phase
    while connection.watch() or not connection.ended.done():
        clock.advance(connection.watch_interval)
        silent += connection.watch_interval
    assert silent <= SILENCE
    assert "silent" in str(connection.ended.result())


def arrived(connection):
    """Wait, on a loop that is stuck meanwhile, until something can be read."""
    while not connection._stream.waiting():
        pass


async def test_what_a_message_asks_begins_before_the_broker_is_answered(connection, broker):
    begun = []

    async def obey():
        with pytest.raises(BlockingIOError):
            broker.hear()
        begun.append("a command")

    broker.end.setblocking(False)
    broker.begin = lambda: begun or asyncio.get_running_loop().create_task(obey())
    broker.say(mqtt5.PublishPacket("t", b"x", qos=mqtt5.QoS.AT_LEAST_ONCE, packet_id=7))
    await broker.is_taken()
    broker.end.settimeout(WITHIN)
    assert await asyncio.to_thread(broker.hear) == [mqtt5.PubAckPacket]
    assert begun == ["a command"]


async def test_what_the_loop_leaves_unread_is_read_by_who_stands_in(connection, broker):
    broker.say(mqtt5.PublishPacket("t", b"stop"))
    arrived(connection)
    connection.read_for_loop()
    assert broker.handed == []  # the loop may be about to read it
    connection.read_for_loop()
    assert [message.payload for message in broker.handed] == [b"stop"]
    assert not broker.taken.is_set()
    await broker.is_taken()


async def test_who_stands_in_acknowledges_what_it_reads_or_the_broker_would_keep_the_rest_back(
    connection, broker
):
    broker.say(mqtt5.PublishPacket("t", b"x", qos=mqtt5.QoS.AT_LEAST_ONCE, packet_id=7))
    arrived(connection)
    for _ in range(5):
        connection.read_for_loop()
    assert len(broker.handed) == 1
    assert broker.hear() == [mqtt5.PubAckPacket]
    assert not broker.taken.is_set()


@pytest.mark.parametrize("step", ["taking it", "obeying it"])
async def test_what_the_loop_gets_stuck_over_is_acknowledged_by_who_stands_in(connection, broker, step):
    heard, over = [], asyncio.Event()

    def get_stuck():
        try:
            connection.read_for_loop()
            broker.end.setblocking(False)
            with pytest.raises(BlockingIOError):  # the loop may be about to answer
                broker.hear()
            connection.read_for_loop()
            broker.end.settimeout(WITHIN)
            heard.extend(broker.hear())
        finally:
            over.set()

    async def obey():
        get_stuck()

    begins = {"taking it": get_stuck, "obeying it": lambda: asyncio.get_running_loop().create_task(obey())}
    broker.begin = begins[step]
    broker.say(mqtt5.PublishPacket("t", b"x", qos=mqtt5.QoS.AT_LEAST_ONCE, packet_id=7))
    await asyncio.wait_for(over.wait(), WITHIN)
    assert heard == [mqtt5.PubAckPacket]


async def test_one_look_reads_all_that_has_arrived_and_the_next_goes_on_at_once(connection, broker):
    many = [mqtt5.PublishPacket("t", bytes(1000)) for _ in range(60)]
    broker.say(*many)
    arrived(connection)
    assert not connection.read_for_loop()
    assert connection.read_for_loop()
    assert len(broker.handed) == 60
    broker.say(mqtt5.PublishPacket("t", b"stop"))
    arrived(connection)
    assert connection.read_for_loop()
    assert broker.handed[-1].payload == b"stop"


async def test_who_stands_in_does_nothing_while_the_loop_reads(connection, broker):
    for number in range(5):
        broker.say(mqtt5.PublishPacket("t", b"%d" % number))
        arrived(connection)
        connection.read_for_loop()
        await broker.is_taken()
    assert [message.payload for message in broker.handed] == [b"0", b"1", b"2", b"3", b"4"]


async def test_a_broker_that_ends_while_the_loop_is_stuck_is_left_to_the_loop(connection, broker):
    broker.say(mqtt5.PublishPacket("t", b"x"))
    broker.end.close()
    arrived(connection)
    for _ in range(5):
        connection.read_for_loop()
    assert not connection.ended.done()
    assert "was lost" in str(await asyncio.wait_for(connection.ended, WITHIN))
    assert len(broker.handed) == 1


async def test_after_nonsense_nothing_is_believed_any_more(connection, broker):
    broker.end.sendall(b"\x00\x00")
    arrived(connection)
    for _ in range(2):
        connection.read_for_loop()
    broker.say(mqtt5.PublishPacket("t", b"x"))
    arrived(connection)
    assert "not an MQTT packet" in str(await asyncio.wait_for(connection.ended, WITHIN))
    assert broker.handed == []


async def test_a_link_is_kept_alive_while_the_loop_is_stuck(connection, broker, clock):
    clock.advance(SETTINGS.keepalive)
    connection.read_for_loop()
    assert broker.hear() == [mqtt5.PingReqPacket]


async def test_a_link_that_is_only_slow_is_not_given_up_and_one_that_takes_no_more_is(
    connection, broker, clock
):
    connection._write(b"\0" * (32 << 20))
    for _ in range(5):
        clock.advance(SETTINGS.keepalive)
        connection.watch()
        before = len(connection._stream._unsent)
        while len(connection._stream._unsent) == before:
            await asyncio.to_thread(broker.end.recv, 1 << 20)
    assert connection.full
    assert not connection.ended.done()
    for _ in range(3):
        connection.watch()
        clock.advance(SETTINGS.keepalive)
    assert "silent" in str(connection.ended.result())


async def test_a_failure_that_nobody_foresaw_ends_the_connection(connection, broker, monkeypatch, caplog):
    monkeypatch.setattr(connection._session, "receive", lambda *_: 1 / 0)
    broker.say(mqtt5.PublishPacket("t", b"x"))
    assert "ZeroDivisionError" in str(await asyncio.wait_for(connection.ended, WITHIN))
    assert "unexpected error" in caplog.text


@pytest.mark.parametrize("what", ["too large", "no text"])
async def test_a_message_for_which_the_connection_ends_is_handed_over_to_be_looked_at_for_a_stop(
    connection, broker, what
):
    if what == "too large":
        broker.end.sendall(b"\x30\xff\xff\xff\x7f\x00\x01t" + b"x" * 2000)
    else:
        packet = mqtt5.PublishPacket("t", b"stop", response_topic="rr").write()
        broker.end.sendall(packet.replace(b"rr", b"\xff\xff"))
    await broker.is_taken()
    (message,) = broker.handed
    assert (message.topic, message.payload) == ("t", b"" if what == "too large" else b"stop")
    assert message.flaw
    await asyncio.wait_for(asyncio.shield(connection.ended), WITHIN)


async def falls(connection, broker):
    broker.end.close()
    await asyncio.wait_for(connection.ended, WITHIN)


async def breaks_the_protocol(connection, broker):
    broker.say(mqtt5.ConnAckPacket())
    await asyncio.wait_for(connection.ended, WITHIN)


async def says_goodbye(connection, broker):
    broker.end.close()
    await connection.disconnect(WITHIN)


async def is_given_up(connection, _broker):
    connection.give_up(CloudError("given up"))


@pytest.fixture
def no_collector():
    """Have what is in a circle of references stay where it is."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize("ends_by", [falls, breaks_the_protocol, says_goodbye, is_given_up])
async def test_a_connection_that_has_ended_is_freed_without_the_garbage_collector(
    ends, broker, clock, no_collector, ends_by
):
    box = OutboundQueue(Spool(SpoolSettings(), clock), 1000, 10**6, CloudStats(), clock)
    session = MqttSession(SETTINGS, {}, box, CloudStats())
    one = MqttConnection(
        ends[0], session, SETTINGS, clock, deliver=broker.handed.extend, dispatch=broker.dispatch
    )
    broker.say(mqtt5.ConnAckPacket())
    await asyncio.wait_for(one.ready, WITHIN)
    await ends_by(one, broker)
    session.end()
    connection_there, session_there = weakref.ref(one), weakref.ref(session)
    broker.begin = None
    del one, session
    for _ in range(3):  # turns of the loop, for calls that were asked for before the end
        await asyncio.sleep(0)
    assert (connection_there(), session_there()) == (None, None)
