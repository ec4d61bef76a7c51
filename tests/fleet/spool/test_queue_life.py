"""A queue through falls, violent deaths, and disks that hang, fail, fill up, break and come late."""

from collections import Counter
from types import MappingProxyType

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from fleet.spool.message import DeliveryOutcome
from fleet.spool.topic_queues import LOW_IN_NEED
from fleet.wire.rules import TrafficClass

REPLY, EVENT = TrafficClass.REPLY, TrafficClass.EVENT


class Life(RuleBasedStateMachine):
    """Through falls, violent deaths, and disks that hang, fail, fill up, break and come late.

    Of what a process has ``taken``, given to it or found on disk, each message is under way, waits, was
    answered or was told lost, and only one of these; and each topic is in order.
    """

    MESSAGES = 2
    TRAFFIC = MappingProxyType({"inbox": REPLY, "event": EVENT})
    TOPICS = st.sampled_from(sorted(TRAFFIC))

    def __init__(self, make_bench):
        super().__init__()
        self.arrived = {topic: [] for topic in self.TRAFFIC}
        self.overtook = set()  # sent before it was known what waits on disk
        self.begin(make_bench(messages=self.MESSAGES), there=True)

    def begin(self, bench, *, there):
        """Begin a new process."""
        self.bench = bench
        self.there = there
        self.writing = None
        self.flying = []
        self.most_flying = 0
        self.sent = set()
        self.answered = {topic: set() for topic in self.TRAFFIC}
        self.taken = Counter()
        self.refused = Counter()
        if there:
            self.take_over()

    def take_over(self):
        """Count what was found on disk."""
        self.taken.update(row.topic for row in self.bench.rows.values())

    @rule(topic=TOPICS, count=st.integers(1, 6), expiry=st.sampled_from([None, None, 10.0]))
    def publish(self, topic, count, expiry):
        for _ in range(count):
            taken = self.bench.put(topic, self.TRAFFIC[topic], expiry=expiry)
            (self.taken if taken else self.refused)[topic] += 1

    @rule(window=st.sampled_from([1, 6]))
    @precondition(lambda self: self.bench.queue.online)
    def send(self, window):
        for message in self.bench.take(window):
            assert message.payload not in self.answered[message.topic]
            assert message.payload not in {other.payload for other in self.flying}
            self.flying.append(message)
            self.sent.add(int(message.payload))
        self.most_flying = max(self.most_flying, len(self.flying))

    @rule(count=st.integers(1, 6), heard=st.booleans())
    @precondition(lambda self: self.flying)
    def answer(self, count, heard):
        if not heard:  # nobody hears: that is so for all that is under way
            count = len(self.flying)
        answered, self.flying = self.flying[:count], self.flying[count:]
        for message in answered:
            outcome = DeliveryOutcome.ACKED if heard else DeliveryOutcome.HELD
            self.bench.queue.settle(message, outcome, self.bench.now, self.bench.wall)
            if heard:
                self.arrive(message.topic, message.payload)

    def arrive(self, topic, payload):
        self.answered[topic].add(payload)
        if int(payload) not in self.arrived[topic]:  # after a death it may come twice
            self.arrived[topic].append(int(payload))

    @rule()
    @precondition(lambda self: self.there and not self.writing)
    def a_change_begins(self):
        self.writing = self.bench.queue.disk.work(self.bench.now)

    @rule(works=st.sampled_from([True, True, False]))
    @precondition(lambda self: self.writing)
    def a_change_ends(self, works):
        self.bench.commit(self.writing, works=works)
        self.writing = None
        self.bench.fetch()

    @rule(count=st.integers(1, 4))
    @precondition(lambda self: self.there)
    def evict(self, count):
        self.bench.evict(count)

    @rule(seconds=st.sampled_from([0.01, 0.3, 20.0]))
    def wait(self, seconds):
        self.bench.now += seconds
        self.bench.queue.tick(self.bench.now, self.bench.wall)

    @rule()
    def come_and_go(self):
        if self.bench.queue.online:
            self.bench.queue.requeue(self.flying)
            self.bench.queue.go_offline()
            self.flying = []
        else:
            self.bench.online()

    @rule(dies=st.booleans(), there=st.booleans())
    @precondition(lambda self: self.there and not self.writing)
    def die_or_lose_the_file(self, dies, there):
        """Lose all that is in memory, as a killed process does, or all that is on disk."""
        if dies:
            self.begin(self.bench.restarted(self.MESSAGES, there=there), there=there)
            return
        self.bench.rows.clear()
        self.bench.queue.disk.lost_disk(self.bench.wall)
        self.bench.look(there=there)
        self.there = there

    @rule()
    @precondition(lambda self: not self.there)
    def the_disk_comes(self):
        self.there = True
        self.overtook |= self.sent
        self.take_over()
        self.bench.look(there=True)

    @invariant()
    def each_topic_is_in_order(self):
        for numbers in self.arrived.values():
            in_turn = [number for number in numbers if number not in self.overtook]
            assert in_turn == sorted(in_turn)

    @invariant()
    def each_message_is_in_one_place(self):
        for topic in self.TRAFFIC:
            flying = sum(message.topic == topic for message in self.flying)
            waiting = len(self.bench.live(topic)) + self.bench.on_disk(topic)
            lost = self.bench.lost(topic) - self.refused[topic]
            assert self.taken[topic] == len(self.answered[topic]) + lost + waiting + flying

    @invariant()
    def the_figures_are_right(self):
        queue, on_disk = self.bench.queue, [self.bench.on_disk(topic) for topic in self.TRAFFIC]
        live = [message for topic in self.TRAFFIC for message in self.bench.live(topic)]
        assert min(on_disk) >= 0
        assert (queue.on_disk, queue.waiting) == (sum(on_disk), sum(on_disk) + len(live))
        assert queue._memory.count <= 2 * self.MESSAGES + 4 * LOW_IN_NEED + self.most_flying
        if self.there and not (self.writing or queue.disk.unwritten):
            assert queue.on_disk == len(self.bench.rows.keys() - {one.seq for one in (*live, *self.flying)})
        assert self.there or not queue.on_disk

    def teardown(self):
        if self.writing:
            self.a_change_ends(works=True)
        if not self.there:
            self.the_disk_comes()
        if not self.bench.queue.online:
            self.come_and_go()
        for _ in range(60):
            self.bench.disk()
            self.wait(20.0)
            self.send(100)
            if self.flying:
                self.answer(1000, heard=True)
        self.each_topic_is_in_order()
        self.each_message_is_in_one_place()
        queue = self.bench.queue
        assert (queue.waiting, queue.on_disk, queue.disk.needs_fetch, self.bench.rows) == (0, 0, False, {})


def test_nothing_is_lost_doubled_or_out_of_order_whatever_comes(make_bench):
    bounds = settings(max_examples=120, stateful_step_count=40)
    run_state_machine_as_test(lambda: Life(make_bench), settings=bounds)
