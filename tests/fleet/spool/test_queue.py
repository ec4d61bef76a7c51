"""The spool's decisions: order, bounds, holds, ages; with a disk that is a dictionary and sometimes fails."""

from collections import Counter
from itertools import pairwise
from types import MappingProxyType

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from fleet.spool.lines import LOW_IN_NEED
from fleet.spool.losses import Reason
from fleet.spool.message import OVERHEAD, Outcome, Outgoing
from fleet.spool.queue import NEWEST_FIRST, Queue
from fleet.spool.spool import AGES
from fleet.spool.unwritten import GRACE
from fleet.wire.rules import Traffic

REPLY, STATUS, EVENT = Traffic.REPLY, Traffic.STATUS, Traffic.EVENT
WALL = 1_800_000_000.0


class Bench:
    """A queue, its disk, its time, and the broker that takes what it sends."""

    def __init__(self, *, messages=5, size=10**6, disk=True, first=0):
        self.now = 1000.0
        self.rows = {}
        self.queue = Queue(messages, size, AGES, disk=disk, first=first)
        self.put_count = 0

    def put(self, topic="t", traffic=EVENT, payload=b"", **more):
        message = Outgoing(topic, payload or b"%d" % self.put_count, 1, traffic, **more)
        self.put_count += 1
        return self.queue.put(message, self.now, WALL)

    def online(self):
        self.queue.go_online(self.now)
        self.now += NEWEST_FIRST
        return self

    def take(self, window=100, reserve=0):
        return self.queue.take(self.now, window=window, reserve=reserve, size=10**6)

    def send(self, window=100, outcome=Outcome.ACKED):
        """Send what may go and have the broker answer; return the payloads."""
        batch = self.take(window)
        for message in batch:
            self.queue.settle(message, outcome, self.now, WALL)
        return [message.payload for message in batch]

    def drain(self):
        """Send and fetch until nothing more comes."""
        sent = []
        while part := [*self.send(), *(self.disk() or self.send())]:
            sent += part
        return sent

    def disk(self, *, works=True):
        """Do what the disk's thread does in one turn."""
        self.commit(self.queue.work(self.now), works=works)
        if works:
            self.fetch()

    def commit(self, work, *, works=True):
        """End a change of the disk, which may have taken long."""
        if not works:
            self.queue.not_written(work)
            return
        for message in work.rows:
            self.rows[message.seq] = message
        for seq in work.done:
            self.rows.pop(seq, None)
        self.queue.losses.changed = False
        self.queue.wrote(work)

    def evict(self, count):
        """Remove the oldest rows, as is done to make room on disk."""
        removed = {}
        for seq in sorted(self.rows)[:count]:
            removed.setdefault(self.rows.pop(seq).topic, []).append(seq)
        for topic, seqs in removed.items():
            self.queue.removed(topic, seqs, Reason.ROOM, WALL)

    def fetch(self):
        """Bring back from disk what is wanted."""
        for fetch in self.queue.fetches():
            found = [
                Outgoing(
                    row.topic,
                    row.payload,
                    1,
                    row.traffic,
                    seq=row.seq,
                    stored=True,
                    since=self.now,
                    deadline=self.now + row.expires - WALL,
                )
                for row in sorted(self.rows.values(), key=lambda row: row.seq)
                if row.topic == fetch.topic and row.seq > fetch.after
            ]
            part = found[: fetch.limit]
            self.queue.fetched(fetch.topic, part, more=len(part) == fetch.limit)

    def restarted(self, messages=5, *, there=True):
        """Return what a new process makes of the disk, or of its memory when no disk is ``there``."""
        other = Bench(messages=messages, first=max(self.rows, default=0))
        other.rows, other.now, other.put_count = self.rows, self.now, self.put_count
        other.look(there=there)
        return other

    def look(self, *, there):
        """Read the disk for the first time, or find that it cannot be read."""
        if not there:
            self.queue.no_disk()
            return
        for topic in dict.fromkeys(row.topic for row in self.rows.values()):
            rows = [row for row in self.rows.values() if row.topic == topic]
            seqs = [row.seq for row in rows]
            self.queue.found(topic, rows[0].traffic, len(rows), min(seqs), max(seqs))

    def live(self, topic):
        """Return what stands in memory of a topic, but what is cold."""
        line = self.queue._lines.get(topic)
        return [one for one in (*line.back, *line.memory) if not one.gone] if line else []

    def cold(self, topic):
        line = self.queue._lines.get(topic)
        return line.cold if line else 0

    def lost(self, topic):
        return sum(gap.lost for gap in self.queue.losses.known() if gap.topic == topic)


def numbers(first, end):
    return [b"%d" % number for number in range(first, end)]


def test_what_is_taken_in_time_never_touches_the_disk():
    bench = Bench().online()
    bench.put()
    assert bench.send() == [b"0"]
    bench.now += 2 * GRACE
    work = bench.queue.work(bench.now)
    assert (list(work.rows), list(work.done)) == ([], [])


def test_what_is_not_taken_in_time_goes_to_disk_and_leaves_it_when_it_is_taken():
    bench = Bench().online()
    bench.put()
    bench.disk()
    assert bench.rows == {}
    bench.now += GRACE
    bench.disk()
    assert len(bench.rows) == 1
    assert bench.send() == [b"0"]
    bench.disk()
    assert bench.rows == {}


def test_without_a_connection_everything_goes_to_disk_at_once():
    bench = Bench()
    bench.put()
    bench.disk()
    assert len(bench.rows) == 1


def test_beyond_the_memory_it_waits_on_disk_alone_and_comes_back_in_order():
    bench = Bench(messages=5)
    for _ in range(30):
        bench.put()
        bench.disk()
    assert (bench.queue.cold, bench.queue.waiting) == (25, 30)
    bench.online()
    assert bench.drain() == numbers(0, 30)
    assert (bench.queue.cold, bench.queue.waiting, bench.rows) == (0, 0, {})


def test_a_new_process_sends_what_the_old_one_left_before_its_own():
    bench = Bench()
    for _ in range(10):
        bench.put()
    bench.disk()
    bench = bench.restarted()
    bench.put()
    assert bench.online().drain() == numbers(0, 11)


def test_what_was_lost_before_the_disk_could_be_read_is_not_counted_with_what_is_on_it():
    bench = Bench()
    for _ in range(4):
        bench.put()
    bench.disk()
    bench.queue.removed("t", [sorted(bench.rows)[1]], Reason.ROOM, WALL)
    bench.queue.found("t", EVENT, 2, 1, 2)
    assert (bench.queue.cold, bench.queue.waiting) == (5, 5)


def test_what_was_under_way_when_the_disk_could_be_read_at_last_is_not_fetched_from_it():
    bench = Bench()
    for _ in range(3):
        bench.put()
    bench.disk()
    bench = bench.restarted(there=False).online()
    bench.put()
    bench.put()
    flying = bench.take()
    bench.look(there=True)
    bench.disk()
    bench.queue.settle(flying[0], Outcome.ACKED, bench.now, WALL)
    assert bench.drain() == [*numbers(0, 3), b"4"]
    assert (bench.queue.cold, bench.queue.waiting, bench.rows) == (0, 0, {})


def test_replies_go_before_status_and_events_wait_for_both():
    bench = Bench(messages=100).online()
    for topic, traffic in (("e", EVENT), ("s", STATUS), ("r", REPLY)):
        bench.put(topic, traffic)
    assert [message.topic for message in bench.take()] == ["r", "s", "e"]


def test_the_end_of_the_window_is_for_replies():
    bench = Bench(messages=100).online()
    for number in range(10):
        bench.put(f"e{number}")
        bench.put(f"r{number}", REPLY)
    taken = bench.take(window=12, reserve=2)
    assert [message.traffic for message in taken] == [REPLY] * 10


def test_the_newest_state_goes_before_what_has_waited_but_replies_do_not_wait_for_it():
    bench = Bench()
    bench.put("e")
    bench.put("r", REPLY)
    bench.queue.go_online(bench.now)
    assert [message.topic for message in bench.take()] == ["r"]
    bench.now += NEWEST_FIRST
    assert [message.topic for message in bench.take()] == ["e"]


def test_a_topic_that_nobody_hears_is_tried_again_ever_more_slowly_and_others_go_on():
    bench = Bench(messages=100).online()
    bench.put("deaf")
    tried = []
    for _ in range(600):
        tried += [bench.now] * len(bench.send(outcome=Outcome.HELD))
        bench.now += 0.1
        bench.queue.tick(bench.now, WALL)
    waits = [round(after - before) for before, after in pairwise(tried)]
    assert waits == [1, 2, 4, 8, 15, 15]
    bench.put("heard")
    assert b"1" in bench.send()


def test_what_waits_for_somebody_to_hear_it_is_counted_apart():
    bench = Bench(messages=100).online()
    for topic in ("deaf", "deaf", "deaf", "heard"):
        bench.put(topic)
    deaf, heard = bench.take()
    bench.queue.settle(deaf, Outcome.HELD, bench.now, WALL)
    assert (bench.queue.waiting, bench.queue.unheard) == (3, 3)
    bench.queue.settle(heard, Outcome.ACKED, bench.now, WALL)
    bench.now += 60.0
    bench.queue.tick(bench.now, WALL)
    bench.queue.settle(bench.take()[0], Outcome.ACKED, bench.now, WALL)
    assert (bench.queue.waiting, bench.queue.unheard) == (2, 0)


def test_somebody_who_comes_back_hears_all_topics_at_once():
    bench = Bench(messages=100).online()
    for topic in "ab":
        bench.put(topic)
    for _ in range(6):
        bench.send(outcome=Outcome.HELD)
        bench.now += 20.0
        bench.queue.tick(bench.now, WALL)
    first = bench.take(window=1)
    assert bench.queue.held == 0
    bench.queue.settle(first[0], Outcome.HELD, bench.now, WALL)
    (second,) = bench.take()
    bench.queue.settle(second, Outcome.ACKED, bench.now, WALL)
    bench.queue.tick(bench.now, WALL)
    assert [message.topic for message in bench.take()] == [first[0].topic]


def test_one_message_asks_whether_anybody_hears_and_the_rest_follows():
    bench = Bench(messages=100).online()
    for _ in range(10):
        bench.put()
    assert len(bench.take()) == 1
    bench.queue.go_offline()


@pytest.mark.parametrize(("traffic", "age"), AGES.items())
def test_what_is_too_old_is_dropped_and_counted(traffic, age):
    bench = Bench(messages=100).online()
    bench.put("t", traffic)
    bench.now += age
    bench.queue.tick(bench.now, WALL)
    assert bench.take() == []
    (gap,) = bench.queue.losses.take()
    assert (gap.topic, gap.reason, gap.lost) == ("t", Reason.AGE, 1)


def test_a_message_may_be_worth_less_time_but_not_more():
    bench = Bench(messages=100).online()
    bench.put("short", expiry=5.0)
    bench.put("long", REPLY, expiry=10**6)
    bench.now += 5.0
    assert [message.topic for message in bench.take()] == ["long"]
    assert bench.queue.losses.total == 1


def test_without_a_disk_the_oldest_of_what_matters_least_is_pushed_out():
    bench = Bench(messages=4, disk=False)
    for topic, traffic in (("s", STATUS), ("e", EVENT), ("r", REPLY), ("e", EVENT), ("r", REPLY)):
        assert bench.put(topic, traffic)
    assert bench.put("s", STATUS)
    assert not bench.put("huge", EVENT, b"x" * 10**7)
    lost = {(gap.topic, gap.lost) for gap in bench.queue.losses.take()}
    assert lost == {("e", 2), ("huge", 1)}
    bench.online()
    assert sorted(message.topic for message in bench.take()) == ["r", "s"]


def test_what_matters_less_never_pushes_out_what_matters_more():
    bench = Bench(messages=2, disk=False)
    assert bench.put("r", REPLY)
    assert bench.put("r", REPLY)
    assert not bench.put("e", EVENT)


@pytest.mark.parametrize("disk", [True, False])
def test_a_message_that_can_never_fit_pushes_nothing_out(disk):
    size = 10 * OVERHEAD
    bench = Bench(messages=100, size=size, disk=disk)
    for topic, traffic in (("r", REPLY), ("r", REPLY), ("e", EVENT)):
        bench.put(topic, traffic)
    for traffic, too_large in ((REPLY, 2 * size), (EVENT, 2 * size - 2 * OVERHEAD)):
        assert not bench.put("huge", traffic, bytes(too_large))
    assert bench.queue.waiting == 3
    assert {(gap.topic, gap.lost) for gap in bench.queue.losses.take()} == {("huge", 2)}


def test_a_full_disk_bounds_memory_and_loses_nothing_within_the_bound():
    bench = Bench(messages=5)
    for _ in range(5):
        bench.put()
    bench.disk(works=False)
    bench.put()
    assert bench.queue.losses.total == 1
    bench.online()
    assert bench.drain() == numbers(1, 6)


def test_what_was_cold_when_the_disk_failed_still_comes_in_order():
    bench = Bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    bench.online()
    sent = bench.send() + bench.send()
    bench.disk(works=False)
    bench.put()
    bench.put()
    for _ in range(10):
        sent += bench.send()
        bench.fetch()
    assert sent == numbers(0, 10)


def test_a_damaged_file_costs_what_was_on_it_alone_and_is_counted():
    bench = Bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    bench.queue.lost_disk(WALL)
    bench.rows.clear()
    assert [(gap.reason, gap.lost) for gap in bench.queue.losses.take()] == [(Reason.CORRUPT, 3)]
    bench.disk()
    assert len(bench.rows) == 5
    assert bench.online().drain() == numbers(0, 5)


def test_what_was_cold_when_the_disk_went_away_is_sent_in_order_and_more_follows():
    bench = Bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.online().queue.no_disk()
    assert bench.queue.cold == 0
    bench.put()
    sent = bench.drain()
    bench.put()
    assert [*sent, *bench.send()] == numbers(9 - 5, 10)
    assert bench.queue.losses.total == 4


def test_what_is_evicted_from_disk_is_lost_unless_it_is_under_way():
    bench = Bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    flying = bench.online().take()
    removed = [bench.rows.pop(seq).seq for seq in sorted(bench.rows)[:6]]
    bench.queue.removed("t", removed, Reason.ROOM, WALL)
    assert [(gap.reason, gap.lost) for gap in bench.queue.losses.take()] == [(Reason.ROOM, 5)]
    bench.queue.settle(flying[0], Outcome.ACKED, bench.now, WALL)
    assert bench.drain() == numbers(6, 8)


def test_what_is_pushed_out_while_the_disk_writes_it_is_lost_and_not_sent():
    bench = Bench(messages=2)
    for _ in range(4):
        bench.put()
    work = bench.queue.work(bench.now)
    for _ in range(4):
        bench.put()
    assert bench.queue.losses.total == 4
    bench.online().commit(work)
    bench.fetch()
    assert bench.drain() == numbers(4, 8)
    assert (bench.queue.cold, bench.queue.waiting, bench.queue.hungry) == (0, 0, False)


@pytest.fixture
def begun_anew():
    """Give a bench whose topic was answered, is begun anew, and whose old rows are still on disk."""
    bench = Bench(messages=2)
    for _ in range(2):
        bench.put("inbox", REPLY)
    bench.disk()
    bench.online().send()
    assert bench.send() == numbers(1, 2)
    for topic in ("other", "other", "inbox"):
        bench.put(topic, REPLY)
    assert len(bench.rows) == 2
    return bench


def test_what_was_acknowledged_is_not_fetched_again_before_it_is_deleted(begun_anew):
    begun_anew.fetch()
    assert begun_anew.queue.cold == 0
    assert sorted(begun_anew.drain()) == numbers(2, 5)
    assert (begun_anew.queue.cold, begun_anew.queue.waiting, begun_anew.rows) == (0, 0, {})


def test_what_was_acknowledged_is_no_loss_when_it_is_evicted_while_it_is_deleted(begun_anew):
    work = begun_anew.queue.work(begun_anew.now)
    begun_anew.evict(2)
    begun_anew.commit(work)
    assert (begun_anew.queue.losses.total, begun_anew.queue.cold) == (0, 1)
    assert sorted(begun_anew.drain()) == numbers(2, 5)


def test_rows_that_cannot_be_deleted_do_not_hide_those_behind_them():
    bench = Bench(messages=2)
    for _ in range(3 * LOW_IN_NEED):
        bench.put("inbox", REPLY)
        bench.disk()
    bench.online()
    while bench.send():
        bench.fetch()
    for topic in ("other", "other", "inbox"):
        bench.put(topic, REPLY)
    for _ in range(4):
        bench.fetch()
    assert bench.queue.cold == 0


def test_a_refused_message_is_lost_and_counted_and_the_next_goes():
    bench = Bench(messages=100).online()
    bench.put()
    bench.put()
    assert bench.send(outcome=Outcome.REFUSED) == [b"0"]
    assert bench.send() == [b"1"]
    assert bench.queue.losses.total == 1


def test_an_inbox_that_was_answered_is_forgotten():
    bench = Bench(messages=100).online()
    for number in range(50):
        bench.put(f"inbox/{number}", REPLY)
    bench.send()
    assert bench.queue._lines == {}
    bench.put("gone", REPLY)
    bench.send(outcome=Outcome.HELD)
    bench.now += AGES[REPLY]
    bench.queue.tick(bench.now, WALL)
    bench.take()
    assert bench.queue._lines == {}
    assert bench.queue.idle


def test_inboxes_whose_answers_grew_too_old_are_forgotten_also_without_a_connection():
    bench = Bench(messages=100)
    for number in range(50):
        bench.put(f"inbox/{number}", REPLY)
    bench.now += AGES[REPLY]
    bench.queue.tick(bench.now, WALL)
    assert bench.queue._lines == {}
    assert bench.queue.idle


def test_topics_that_were_pushed_out_are_forgotten_and_can_begin_anew():
    bench = Bench(messages=1, disk=False)
    for topic in "abcab":
        assert bench.put(topic)
    assert list(bench.queue._lines) == ["b"]
    assert bench.online().drain() == numbers(4, 5)
    assert bench.queue.idle


def test_a_message_that_is_refused_leaves_no_topic_behind():
    bench = Bench(disk=False)
    assert not bench.put("huge", EVENT, b"x" * 10**7)
    assert bench.queue._lines == {}


@pytest.mark.parametrize("disk", [True, False])
def test_what_was_pushed_out_is_not_kept_in_memory(disk):
    bench = Bench(messages=5, disk=disk)
    bench.disk(works=False)
    for _ in range(100):
        bench.put()
    assert bench.queue.losses.total == 95
    assert len(bench.queue._lines["t"].memory) == 5


def test_what_came_back_and_was_pushed_out_is_not_kept_in_memory():
    bench = Bench(messages=5, disk=False).online()
    for _ in range(5):
        bench.put()
    bench.send()
    bench.queue.put_back(bench.take())
    for _ in range(4):
        bench.put()
    assert [message.payload for message in bench.queue._lines["t"].back] == [b"4"]


def test_memory_holds_no_more_than_its_bound_for_each_kind_of_bound():
    bench = Bench(messages=100, size=3 * (OVERHEAD + 10), disk=False)
    for _ in range(10):
        assert bench.put(payload=b"x" * 10)
    assert bench.queue.waiting == 3


class Life(RuleBasedStateMachine):
    """Through falls, violent deaths, and disks that hang, fail, fill up, break and come late.

    Of what a process has ``taken``, given to it or found on disk, each message is under way, waits, was
    answered or was told lost, and only one of these; and each topic is in order.
    """

    MESSAGES = 2
    TRAFFIC = MappingProxyType({"inbox": REPLY, "event": EVENT})
    TOPICS = st.sampled_from(sorted(TRAFFIC))

    def __init__(self):
        super().__init__()
        self.arrived = {topic: [] for topic in self.TRAFFIC}
        self.overtook = set()  # sent before it was known what waits on disk
        self.begin(Bench(messages=self.MESSAGES), there=True)

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
            outcome = Outcome.ACKED if heard else Outcome.HELD
            self.bench.queue.settle(message, outcome, self.bench.now, WALL)
            if heard:
                self.arrive(message.topic, message.payload)

    def arrive(self, topic, payload):
        self.answered[topic].add(payload)
        if int(payload) not in self.arrived[topic]:  # after a death it may come twice
            self.arrived[topic].append(int(payload))

    @rule()
    @precondition(lambda self: self.there and not self.writing)
    def a_change_begins(self):
        self.writing = self.bench.queue.work(self.bench.now)

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
        self.bench.queue.tick(self.bench.now, WALL)

    @rule()
    def come_and_go(self):
        if self.bench.queue.online:
            self.bench.queue.put_back(self.flying)
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
        self.bench.queue.lost_disk(WALL)
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
            waiting = len(self.bench.live(topic)) + self.bench.cold(topic)
            lost = self.bench.lost(topic) - self.refused[topic]
            assert self.taken[topic] == len(self.answered[topic]) + lost + waiting + flying

    @invariant()
    def the_figures_are_right(self):
        queue, cold = self.bench.queue, [self.bench.cold(topic) for topic in self.TRAFFIC]
        live = [message for topic in self.TRAFFIC for message in self.bench.live(topic)]
        assert min(cold) >= 0
        assert (queue.cold, queue.waiting) == (sum(cold), sum(cold) + len(live))
        assert queue._memory.count <= 2 * self.MESSAGES + 4 * LOW_IN_NEED + self.most_flying
        if self.there and not (self.writing or queue.unwritten):
            assert queue.cold == len(self.bench.rows.keys() - {one.seq for one in (*live, *self.flying)})
        assert self.there or not queue.cold

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
        assert (queue.waiting, queue.cold, queue.hungry, self.bench.rows) == (0, 0, False, {})


TestLife = Life.TestCase
TestLife.settings = settings(max_examples=200, stateful_step_count=40)
