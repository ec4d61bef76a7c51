"""The core of the broker: who is admitted, where messages and wills go, and when a session ends."""

import asyncio

import mqtt5
import pytest

from fleet.sim.broker.broker_core import BrokerCore
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.session import NEVER, BrokerSubscription
from fleet.testing.clock import JumpingLoop, LoopClock

TAKEN_OVER = mqtt5.DisconnectReasonCode.SESSION_TAKEN_OVER
TOO_SLOW = mqtt5.DisconnectReasonCode.QUOTA_EXCEEDED
Refusal = mqtt5.ConnAckReasonCode


class Peer:
    """The connection of a client: what it was sent, last ``at``, and why it was disconnected."""

    def __init__(self, hub, name, session):
        self.hub, self.name, self.session = hub, name, session
        self.got, self.writes, self.why, self.reads = [], 0, None, True

    def flush(self):
        self.writes += 1
        if self.reads:
            packets = self.session.send(self.hub.clock.monotonic())
            self.got += [(packet.topic, packet.payload, packet.retain) for packet in packets]
            self.at = self.hub.clock.monotonic()

    def disconnect_client(self, reason):
        self.why = reason
        self.hub.leave(self.session, None)

    def subscribe(self, pattern="#", **options):
        self.hub.subscribe(self.session, BrokerSubscription(mqtt5.TopicFilter(pattern, **options)))

    def publish(self, payload=b"x", **fields):
        return self.hub.publish(mqtt5.PublishPacket("a", payload, **fields), self.session)


class Bench:
    """A broker without sockets; its clock is that of the loop."""

    def __init__(self, *, limits=None, check=None, tells_unheard=True, **faults):
        self.clock = LoopClock(asyncio.get_running_loop())
        self.faults = BrokerFaults(**faults)
        limits = ClientLimits(**limits or {})
        self.hub = BrokerCore(self.clock, limits, self.faults, check, tells_unheard=tells_unheard)

    def refusal(self, name="ann", **fields):
        return self.hub.refusal(mqtt5.ConnectPacket(name, **fields))

    def join(self, name, *, expiry=0, **fields):
        """Admit a client that subscribes to nothing yet; return its connection."""
        packet = mqtt5.ConnectPacket(name, session_expiry_interval=expiry, **fields)
        peer = Peer(self.hub, name, None)
        peer.session, peer.present = self.hub.admit(packet, peer)
        return peer


def in_time(work, **options):
    """Return what ``work(bench)`` returns, in time that jumps."""

    async def whole():
        return await work(Bench(**options))

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


REFUSALS = [
    ({"refuse": 0x87}, {}, Refusal.NOT_AUTHORIZED),
    ({}, {"authentication_method": "SCRAM"}, Refusal.BAD_AUTHENTICATION_METHOD),
    ({"check": lambda name, _: name == "ann"}, {"username": "ann"}, None),
    ({"check": lambda name, _: name == "ann"}, {"username": "eve"}, Refusal.BAD_USER_NAME_OR_PASSWORD),
    ({"check": lambda _, password: password == b"p"}, {}, Refusal.BAD_USER_NAME_OR_PASSWORD),
    ({"limits": {"sessions": 0}}, {}, Refusal.QUOTA_EXCEEDED),
]


@pytest.mark.parametrize(("options", "connect", "refusal"), REFUSALS)
def test_a_client_is_refused_with_the_reason(options, connect, refusal):
    async def work(bench):
        return bench.refusal(**connect)

    assert in_time(work, **options) == refusal


def test_a_full_broker_admits_those_it_knows_and_others_when_a_session_has_ended():
    async def work(bench):
        bench.hub.leave(bench.join("ann", expiry=5).session, None)
        found = [bench.refusal("ann"), bench.refusal("bob")]
        await asyncio.sleep(5.0)
        return [*found, bench.refusal("bob")]

    assert in_time(work, limits={"sessions": 1}) == [None, Refusal.QUOTA_EXCEEDED, None]


LASTING = [
    (5, 4.9, False, True),
    (5, 5.0, False, False),
    (0, 0.0, False, False),
    (NEVER, 1e5, False, True),
    (5, 1.0, True, False),
]


@pytest.mark.parametrize(("expiry", "away", "clean", "present"), LASTING)
def test_a_session_lasts_as_long_as_it_was_asked_for(expiry, away, clean, present):
    async def work(bench):
        first = bench.join("ann", expiry=expiry)
        first.subscribe()
        bench.hub.leave(first.session, None)
        await asyncio.sleep(away)
        again = bench.join("ann", clean_start=clean)
        return again.present, again.session is first.session, bool(again.session.subscriptions)

    assert in_time(work) == (present, present, present)


def test_a_second_client_of_the_same_name_takes_over():
    async def work(bench):
        first, second = bench.join("ann", expiry=5), bench.join("ann", expiry=5)
        return first.why, second.present, bench.hub.peers == {"ann": second}

    assert in_time(work) == (TAKEN_OVER, True, True)


def test_a_client_is_sent_no_more_at_once_than_both_sides_take():
    async def work(bench):
        return [bench.join(str(most), receive_max=most).session.window for most in (3, 50)]

    assert in_time(work, limits={"receive": 10}) == [3, 10]


def test_messages_of_one_turn_are_written_together():
    async def work(bench):
        (ann := bench.join("ann")).subscribe()
        assert [ann.publish(b"1"), ann.publish(b"2"), ann.writes] == [True, True, 0]
        await asyncio.sleep(0)
        return ann.writes, [payload for _, payload, _ in ann.got]

    assert in_time(work) == (1, [b"1", b"2"])


@pytest.mark.parametrize("tells", [True, False])
def test_a_message_without_a_subscriber_is_told_where_that_is_wanted(tells):
    async def work(bench):
        return bench.join("ann").publish()

    assert in_time(work, tells_unheard=tells) is not tells


def test_a_client_that_wants_nothing_of_its_own_is_no_subscriber_of_it():
    async def work(bench):
        (ann := bench.join("ann")).subscribe(no_local=True)
        return ann.publish(), bench.join("bob").publish()

    assert in_time(work) == (False, True)


@pytest.mark.parametrize(("handling", "times"), [(0, [1, 2]), (1, [1, 1]), (2, [0, 0])])
def test_what_is_retained_comes_at_each_subscription_or_the_first_or_never(handling, times):
    async def work(bench):
        ann = bench.join("ann")
        ann.publish(retain=True)
        found = []
        for _ in times:
            ann.subscribe(retain_handling=mqtt5.RetainHandling(handling))
            await asyncio.sleep(0)
            found.append(len(ann.got))
        return found, {retain for *_, retain in ann.got}

    assert in_time(work) == (times, {True} if any(times) else set())


FAULTS = [({"drop": "a"}, []), ({"duplicate": "a"}, [b"x", b"x"]), ({"duplicate": "b", "drop": "b"}, [b"x"])]


@pytest.mark.parametrize(("faults", "got"), FAULTS)
def test_faults_apply_to_the_topics_that_they_name(faults, got):
    async def work(bench):
        ann = bench.join("ann")
        ann.subscribe()
        assert ann.publish()
        await asyncio.sleep(0)
        return [payload for _, payload, _ in ann.got]

    assert in_time(work, **faults) == got


def test_what_is_delayed_goes_to_those_who_subscribed_in_time():
    async def work(bench):
        ann, bob = bench.join("ann"), bench.join("bob")
        ann.subscribe()
        ann.publish()
        bob.subscribe()
        await asyncio.sleep(1.9)
        early = len(ann.got)
        await asyncio.sleep(0.2)
        return early, len(ann.got), len(bob.got)

    assert in_time(work, delay=2.0) == (0, 1, 0)


@pytest.mark.parametrize("reads", [True, False])
def test_a_client_that_is_too_slow_is_expelled_once_it_cannot_be_written_to(reads):
    async def work(bench):
        ann = bench.join("ann")
        ann.subscribe()
        ann.reads = reads
        for _ in range(3):
            bench.join("bob").publish()
        await asyncio.sleep(0)
        return ann.why, len(ann.got)

    assert in_time(work, limits={"queue": 2}) == ((None, 3) if reads else (TOO_SLOW, 0))


WILL = mqtt5.Will("a", payload=b"gone", retain=True, will_delay_interval=3)


@pytest.mark.parametrize(("expiry", "after"), [(10, 3.0), (2, 2.0), (0, 0.0)])
def test_a_will_waits_for_its_delay_or_the_end_of_the_session_whichever_is_first(expiry, after):
    async def work(bench):
        watcher, ann = bench.join("watcher"), bench.join("ann", expiry=expiry)
        watcher.subscribe()
        began = bench.clock.monotonic()
        bench.hub.leave(ann.session, WILL)
        await asyncio.sleep(20.0)
        return watcher.got, watcher.at - began

    assert in_time(work) == ([("a", b"gone", True)], pytest.approx(after))


@pytest.mark.parametrize("end", [lambda bench: bench.join("ann", expiry=10), lambda bench: bench.hub.close()])
def test_a_delayed_will_is_not_published_when_there_is_no_more_reason(end):
    async def work(bench):
        watcher, ann = bench.join("watcher"), bench.join("ann", expiry=10)
        watcher.subscribe()
        bench.hub.leave(ann.session, WILL)
        end(bench)
        await asyncio.sleep(20.0)
        return watcher.got

    assert in_time(work) == []
