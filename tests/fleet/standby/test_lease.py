"""The lease machine: its table, and that no two edges may ever write to a robot."""

import heapq
import itertools
from dataclasses import dataclass, field
from functools import partial

import pytest
from hypothesis import given, settings, target
from hypothesis import strategies as st

from fleet.standby.lease import (
    TRANSITIONS,
    Lease,
    LeaseAction,
    LeaseEntry,
    LeaseEvent,
    LeaseState,
    LeaseTimes,
)

TERMS = LeaseTimes()
STEP = 0.1  # s between two turns of a node
PATIENCE = 0.7  # s for which a node waits for an answer


def holder(lease, now=100.0, revision=7):
    """Let a lease be taken."""
    lease.observe(None, 0, now - TERMS.length)
    assert lease.next_write(now) is LeaseAction.TAKE
    lease.written(lease.begin(LeaseAction.TAKE, {}, now), revision, now + 0.01)
    assert lease.state is LeaseState.HOLDER
    return lease


@pytest.fixture
def a():
    return Lease("a", "a-1", TERMS)


@pytest.fixture
def b():
    return Lease("b", "b-1", TERMS)


def test_no_way_leads_from_fenced_back_to_holder():
    assert LeaseState.HOLDER not in {
        TRANSITIONS.get((LeaseState.FENCED, event), LeaseState.FENCED) for event in LeaseEvent
    }


def test_an_edge_waits_for_the_length_of_the_lease_where_there_is_no_entry(a):
    a.observe(None, 0, 10.0)
    assert a.next_write(12.9) is None
    assert a.next_write(13.0) is LeaseAction.TAKE


def test_an_edge_that_has_read_nothing_takes_nothing(a):
    assert a.next_write(1e9) is None


def test_the_epoch_is_the_revision_with_which_the_lease_was_taken(a):
    holder(a, revision=41)
    entry = a.begin(LeaseAction.RENEW, {}, 101.0)
    a.written(entry, 42, 101.1)
    assert (a.epoch, entry.epoch) == (41, 41)


def test_a_renewal_counts_from_the_moment_it_was_begun(a):
    holder(a, now=100.0)
    a.written(a.begin(LeaseAction.RENEW, {}, 100.5), 8, 101.4)
    assert a.motion_until == 100.5 + TERMS.length - TERMS.standstill
    assert a.writes_until == 100.5 + TERMS.length - TERMS.margin


def test_motion_ends_before_the_lease_does_and_nothing_is_written_at_its_end(a):
    holder(a, now=100.0)
    a.tick(100.0 + TERMS.length - TERMS.standstill)
    assert a.state is LeaseState.FENCED
    assert a.motion_until == -float("inf")
    assert a.writes_until < 100.0 + TERMS.length


def test_a_lease_that_was_taken_too_late_is_not_held(a):
    a.observe(None, 0, 0.0)
    entry = a.begin(LeaseAction.TAKE, {}, 3.0)
    a.written(entry, 1, 5.5)
    assert a.state is LeaseState.STANDBY


def test_a_renewal_whose_answer_was_lost_is_found_in_the_store(a):
    holder(a, now=100.0)
    entry = a.begin(LeaseAction.RENEW, {}, 100.5)
    a.unanswered()
    assert a.next_write(100.9) is None
    a.observe(entry, 8, 101.0)
    assert (a.state, a.next_write(101.0), a.revision) == (LeaseState.HOLDER, LeaseAction.RENEW, 8)


@pytest.mark.parametrize("entry", [None, LeaseEntry("b", "b-1", 9)])
def test_a_holder_that_does_not_find_its_entry_is_fenced(a, entry):
    holder(a)
    a.begin(LeaseAction.RENEW, {}, 100.5)
    a.refused()
    a.observe(entry, 9 if entry else 0, 100.6)
    assert a.state is LeaseState.FENCED


def test_a_standby_takes_a_lease_that_was_handed_to_it_at_once(b):
    b.observe(LeaseEntry("a", "a-1", 7, released=True, to="b"), 9, 50.0)
    assert b.next_write(50.0) is LeaseAction.TAKE


def test_an_edge_with_another_file_does_not_take_over_until_that_is_accepted(b):
    b.config = "mine"
    entry = LeaseEntry("a", "a-1", 7, released=True, config="other")
    b.observe(entry, 9, 50.0)
    assert (b.next_write(60.0), b.differs) == (None, True)
    b.accept()
    assert (b.next_write(60.0), b.differs) == (LeaseAction.TAKE, False)
    b.observe(LeaseEntry("a", "a-1", 7, config="yet another"), 10, 61.0)
    assert b.next_write(70.0) is None, "only that file was accepted"
    b.config = "yet another"
    assert b.next_write(70.0) is LeaseAction.TAKE


@pytest.mark.parametrize(
    "entry",
    [
        LeaseEntry("a", "a-1", 7),
        LeaseEntry("b", "b-0", 7, config="before"),
        LeaseEntry("a", "a-1", config="mine"),
    ],
)
def test_a_file_that_is_unknown_or_our_own_keeps_no_edge_from_taking_over(b, entry):
    """An older edge tells none, and an edge that starts again has changed its own."""
    b.config = "mine"
    b.observe(entry, 9, 50.0)
    assert b.next_write(60.0) is LeaseAction.TAKE
    assert b.begin(LeaseAction.TAKE, {}, 60.0).config == "mine"


def test_nobody_else_takes_a_lease_that_was_handed_to_an_edge_before_its_length_has_passed(a):
    a.observe(LeaseEntry("c", "c-1", 7, released=True, to="b"), 9, 50.0)
    assert a.next_write(52.9) is None
    assert a.next_write(53.0) is LeaseAction.TAKE


def test_an_edge_that_gave_the_lease_away_does_not_take_it_back_at_once(a):
    holder(a)
    a.hand_over("b")
    assert a.next_write(100.2) is None
    a.robots_released()
    assert a.next_write(100.3) is LeaseAction.RELEASE
    entry = a.begin(LeaseAction.RELEASE, {"rover": "asked"}, 100.3)
    assert (entry.released, entry.to, entry.stops) == (True, "b", {"rover": "asked"})
    a.written(entry, 8, 100.4)
    assert a.next_write(103.3) is None
    assert a.next_write(103.5) is LeaseAction.TAKE


def test_an_edge_whose_lease_lapsed_releases_it_once_its_robots_are_let_go_of(a):
    holder(a, now=100.0)
    a.tick(102.5)
    assert a.next_write(102.6) is None
    a.robots_released()
    assert a.next_write(102.7) is LeaseAction.RELEASE


def test_news_of_a_stop_is_written_at_once(a):
    holder(a)
    assert a.next_write(100.1) is None
    assert a.next_write(100.1, stops_changed=True) is LeaseAction.RENEW


def test_a_takeover_knows_whether_the_robots_were_let_go_of(a, b):
    b.observe(LeaseEntry("a", "a-1", 7, released=True), 9, 50.0)
    b.written(b.begin(LeaseAction.TAKE, {}, 50.1), 10, 50.2)
    assert (b.takeover.orderly, b.takeover.since) == (True, 50.0)
    holder(a)
    assert not a.takeover.orderly


# -- two edges, a store, and everything that can go wrong ---------------------------------------------------


@dataclass
class Node:
    """An edge in the model: its lease, its clock (offset and rate), and until when it is paused."""

    lease: Lease
    offset: float
    rate: float
    paused_until: float = 0.0
    cut_until: float = 0.0
    looking: bool = False
    epochs: list = field(default_factory=list)
    troubles: list = field(default_factory=list)  # what befalls it as soon as a write of its own is stored

    @property
    def holds(self):
        return self.lease.state is LeaseState.HOLDER

    def now(self, real):
        return self.offset + real * self.rate

    def ends(self, real):
        """Return in how many seconds its last byte may be written; negative if that was before."""
        return (self.lease.writes_until - self.now(real)) / self.rate


class World:
    """Two nodes and a store; messages take their time, or are lost. ``trouble`` is drawn by Hypothesis."""

    def __init__(self, nodes, delays, losses):
        self.nodes = nodes
        self.delays, self.losses = itertools.cycle(delays), itertools.cycle(losses)
        self.entry, self.revision = None, 0
        self.due, self.count, self.real = [], itertools.count(), 0.0
        self.epochs = []
        self.closest = -10.0  # s from a takeover back to when the other one could still write

    def later(self, delay, call):
        heapq.heappush(self.due, (self.real + delay, next(self.count), call))

    def advance(self, until):
        """Let time pass; nobody may write beside another at any moment at which something happens."""
        while self.due and self.due[0][0] <= until:
            self.real, _, call = heapq.heappop(self.due)
            call()
            self.check()
        self.real = until
        self.check()

    def check(self):
        writing = [node for node in self.nodes if node.now(self.real) < node.lease.writes_until]
        assert len(writing) <= 1, [(node.lease.edge, node.lease.state) for node in writing]
        for node in writing:
            if node.lease.epoch not in node.epochs:
                self.closest = max(
                    self.closest, *(each.ends(self.real) for each in self.nodes if each is not node)
                )
                assert not self.epochs or node.lease.epoch > self.epochs[-1]
                node.epochs.append(node.lease.epoch)
                self.epochs.append(node.lease.epoch)

    def turn(self, node):
        """One turn of a node that is not paused, as its keeper takes it."""
        now, lease = node.now(self.real), node.lease
        lease.tick(now)
        if lease.state is LeaseState.FENCED:
            lease.robots_released()
        action = lease.next_write(now)
        if action is not None:
            entry = lease.begin(action, {}, now)
            self.send(node, entry, lease.revision)
        elif lease.needs_read and not node.looking:
            node.looking = True
            self.later(next(self.delays), lambda: self.answer_look(node))

    def turns(self, node):
        if node.paused_until == float("inf"):
            return
        if self.real >= node.paused_until:
            self.turn(node)
        self.later(STEP, lambda: self.turns(node))

    def lost(self, node):
        return self.real < node.cut_until or next(self.losses)

    def send(self, node, entry, last):
        """Send a write; the request may be lost or come late, and so may the answer."""
        ended = []  # the write is answered once: by the store, or by the end of the patience
        if not self.lost(node):
            self.later(next(self.delays), lambda: self.store(node, entry, last, ended))
        self.later(PATIENCE, lambda: self.receive(node, ended, node.lease.unanswered))

    def store(self, node, entry, last, ended):
        """Carry a write out, if nobody wrote before, and answer."""
        if last != self.revision_of_entry():
            self.later(next(self.delays), lambda: self.receive(node, ended, node.lease.refused))
            return
        self.revision += 1
        self.entry = (entry, revision := self.revision)
        while node.troubles:
            node.troubles.pop()()
        if not self.lost(node):

            def confirm():
                node.lease.written(entry, revision, node.now(self.real))

            self.later(next(self.delays), lambda: self.receive(node, ended, confirm))

    def revision_of_entry(self):
        return self.entry[1] if self.entry else 0

    def receive(self, node, ended, tell):
        if self.real < node.paused_until:
            if node.paused_until < float("inf"):
                self.later(node.paused_until - self.real, lambda: self.receive(node, ended, tell))
        elif not ended:
            ended.append(True)
            tell()

    def answer_look(self, node):
        found = self.entry or (None, 0)
        lost = self.lost(node)

        def arrive():
            if self.real < node.paused_until:
                if node.paused_until < float("inf"):
                    self.later(node.paused_until - self.real, arrive)
                return
            node.looking = False
            if not lost:
                node.lease.observe(*found, node.now(self.real))

        self.later(next(self.delays), arrive)


TROUBLES = st.tuples(
    st.floats(0.05, 3.0),  # s until the next one
    st.sampled_from(("pause", "cut", "restart", "hand over", "delete")),
    st.booleans(),  # whether it befalls the holder, or the other
    st.floats(0.1, 2.0) | st.floats(3.0, 8.0),  # how long, s: shorter than a lease, or longer
    st.booleans(),  # whether it waits for a write of the node
)
DELAYS = st.just([0.0]) | st.lists(st.floats(0.0, 0.1) | st.floats(0.0, 1.5), min_size=1, max_size=7)
LOSSES = st.just([False]) | st.lists(st.booleans(), min_size=1, max_size=7)
RATES = st.sampled_from((0.96, 1.0, 1.04)) | st.floats(0.96, 1.04)
"""A twelfth apart at most, which a lease has to bear."""
CLOCKS = st.tuples(st.floats(0, 1e6), RATES)


@settings(max_examples=500, deadline=None)
@given(
    alone=st.sampled_from((0.0, 5.0)),
    clocks=st.tuples(CLOCKS, CLOCKS),
    delays=DELAYS,
    losses=LOSSES,
    troubles=st.lists(TROUBLES, min_size=1, max_size=12),
)
def test_two_edges_never_may_write_at_once_whatever_happens(alone, clocks, delays, losses, troubles):
    """``alone``: s before the first trouble; in five seconds one of them comes to hold the lease."""
    nodes = [
        Node(Lease(name, f"{name}-0", TERMS), offset, rate)
        for name, (offset, rate) in zip("ab", clocks, strict=True)
    ]
    world = World(nodes, delays, losses)
    for node in nodes:
        world.turns(node)
    world.advance(alone)
    for number, (after, kind, holder, seconds, waits) in enumerate(troubles):
        which = next((index for index, node in enumerate(nodes) if node.holds is holder), 0)
        node = nodes[which]
        befalls = partial(trouble, world, kind, which, seconds, number)
        if waits:
            node.troubles.append(befalls)
        else:
            befalls()
        world.advance(world.real + after)
    world.advance(world.real + 10.0)
    target(world.closest)  # a takeover as early as possible, and what comes next, is too early


def trouble(world, kind, which, seconds, number):
    """Let something befall a node, or the store."""
    node = world.nodes[which]
    if kind == "pause":
        node.paused_until = max(node.paused_until, world.real + seconds)
    elif kind == "cut":
        node.cut_until = world.real + seconds
    elif kind == "restart" and node.lease.state is not LeaseState.FENCED:
        restart(world, which, number)
    elif kind == "hand over":
        node.lease.hand_over("ab"[1 - which])
    elif kind == "delete":  # by a person; a marker with a revision of its own is left
        world.revision += 1
        world.entry = (None, world.revision)


def restart(world, which, number):
    """Replace a node's process: the earlier one writes no more, as one that was killed."""
    old = world.nodes[which]
    new = Node(Lease(old.lease.edge, f"{old.lease.edge}-{number + 1}", TERMS), old.offset, old.rate)
    old.paused_until = float("inf")
    old.lease.state = LeaseState.STANDBY
    world.nodes[which] = new
    world.turns(new)


def test_the_lease_is_taken_over_within_four_seconds_of_the_holders_end():
    nodes = [Node(Lease(name, f"{name}-0", TERMS), 0.0, 1.0) for name in "ab"]
    world = World(nodes, [0.01], [False])
    for node in nodes:
        world.turns(node)
    world.advance(6.0)
    first = next(node for node in nodes if node.lease.state is LeaseState.HOLDER)
    other = next(node for node in nodes if node is not first)
    first.paused_until = float("inf")
    world.advance(10.0)
    assert other.lease.state is LeaseState.HOLDER
