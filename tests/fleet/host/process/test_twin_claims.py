"""Edges with one twin on a simulated bus whose tokens take their time: none runs the robot beside another."""

import heapq
import itertools
import random

import pytest

from fleet.bus import keys
from fleet.host.process.twin_claims import LOOK_AGAIN, SEEN_WITHIN, SETTLE, TwinClaims

TWIN = "t"


class Loop:
    """Calls in the order of their times; the clock is theirs."""

    def __init__(self):
        self.now = 0.0
        self._calls = []
        self._count = itertools.count()

    def call_later(self, seconds, call, *arguments):
        heapq.heappush(self._calls, (self.now + seconds, next(self._count), call, arguments))

    def call_soon(self, call, *arguments):
        self.call_later(0.0, call, *arguments)

    call_soon_threadsafe = call_soon

    def run(self, until):
        while self._calls and self._calls[0][0] <= until:
            self.now, _, call, arguments = heapq.heappop(self._calls)
            call(*arguments)
        self.now = until


class Bus:
    """Tokens of all edges; each is seen by each other edge a while later, in order."""

    def __init__(self, loop, delay):
        self._loop = loop
        self._delay = delay
        self.tokens = {}
        self._sessions = []
        self.cut = False

    def bus_session(self, edge):
        return BusSession(self, edge)

    def join(self, bus_session):
        self._sessions.append(bus_session)
        for key, owner in self.tokens.items():
            if owner is not bus_session and not self.cut:
                self.show(bus_session, key, True)

    def change(self, owner, key, alive):
        if alive:
            self.tokens[key] = owner
        else:
            self.tokens.pop(key, None)
        for bus_session in self._sessions:
            if bus_session is not owner and not self.cut:
                self.show(bus_session, key, alive)

    def show(self, bus_session, key, alive):
        at = bus_session.last = max(bus_session.last, self._loop.now + self._delay())
        self._loop.call_later(at - self._loop.now, bus_session.seen, key, alive)

    def heal(self):
        self.cut = False
        for key, owner in self.tokens.items():
            for bus_session in self._sessions:
                if bus_session is not owner:
                    self.show(bus_session, key, True)


class BusSession:
    def __init__(self, bus, edge):
        self._bus = bus
        self.edge = edge
        self.last = 0.0
        self.alive = True
        self._call = lambda *_: None

    def token(self, key):
        self._bus.change(self, key, True)
        return lambda: self._bus.change(self, key, False)

    def watch_tokens(self, _key, call):
        self._call = call
        self._bus.join(self)

    def seen(self, key, alive):
        if self.alive:
            self._call(key, alive)

    def die(self):
        self.alive = False
        for key in [key for key, owner in self._bus.tokens.items() if owner is self]:
            self._bus.change(self, key, False)


class Yard:
    """Edges that execute for as long as they are told that the twin is theirs; ``both`` counts overlaps."""

    def __init__(self, monkeypatch, delay):
        self.loop = Loop()
        self.bus = Bus(self.loop, delay)
        self.running = set()
        self.moving = set()
        self.both = 0
        self.ran = []
        monkeypatch.setattr("fleet.host.process.twin_claims.asyncio.get_running_loop", lambda: self.loop)

    def edge(self, name, skew=0.0, pair=(), settle=SETTLE):
        class Clock:
            time = staticmethod(lambda: 1000.0 + self.loop.now + skew)

        bus_session = self.bus.bus_session(name)
        claims = TwinClaims(
            name,
            [TWIN],
            bus_session,
            settle=settle,
            changed=lambda _twin, holder: self.changed(name, holder),
            moves=lambda _twin: name in self.moving,
            clock=Clock(),
        )
        claims.pair = frozenset(pair)
        claims.start()
        return bus_session

    def changed(self, name, holder):
        if holder:
            self.running.discard(name)
        else:
            self.running.add(name)
            self.ran.append(name)
        self.both += len(self.running) > 1

    def die(self, bus_session):
        self.running.discard(bus_session.edge)
        bus_session.die()


@pytest.mark.parametrize("seed", range(40))
def test_no_two_edges_ever_run_one_robot_and_one_of_them_does(monkeypatch, seed):
    rng = random.Random(seed)
    for _ in range(50):
        yard = Yard(monkeypatch, lambda: rng.uniform(0.0, 0.999 * SEEN_WITHIN))
        edges = rng.choice([2, 2, 3])
        for number in range(edges):
            at, skew = rng.uniform(0, 3 * SETTLE), rng.uniform(-5, 5)
            yard.loop.call_later(at, yard.edge, f"yard-{number}", skew)
        yard.loop.run(12 * SETTLE)
        assert yard.both == 0
        assert len(yard.running) == 1
        for name in sorted(yard.running):
            bus_session = next(bus_session for bus_session in yard.bus._sessions if bus_session.edge == name)
            yard.die(bus_session)
        yard.loop.run(24 * SETTLE)
        assert yard.both == 0
        assert len(yard.running) == 1, "another takes it over"


def test_of_two_that_have_it_the_later_gives_way_when_its_robot_stands(monkeypatch):
    yard = Yard(monkeypatch, lambda: 0.01)
    yard.bus.cut = True
    yard.edge("yard-0")
    yard.loop.run(1.0)
    yard.edge("yard-1")
    yard.loop.run(5 * SETTLE)
    assert yard.running == {"yard-0", "yard-1"}, "neither sees the other"
    yard.moving = {"yard-1"}
    yard.bus.heal()
    yard.loop.run(9 * SETTLE)
    assert "yard-1" in yard.running, "a claim interrupts no motion"
    yard.moving = set()
    yard.loop.run(9 * SETTLE + 2 * LOOK_AGAIN)
    assert yard.running == {"yard-0"}


def test_where_no_other_edge_can_be_a_twin_is_claimed_at_once_and_shown_once(monkeypatch):
    yard = Yard(monkeypatch, lambda: 0.0)
    shown = []
    monkeypatch.setattr(BusSession, "token", lambda _session, key: shown.append(key) or (lambda: None))
    yard.edge("barn", settle=0.0)
    assert (yard.ran, len(shown)) == (["barn"], 1)
    assert shown[0].endswith(keys.HELD)


def test_a_forged_claim_of_long_ago_takes_no_robot(monkeypatch):
    yard = Yard(monkeypatch, lambda: 0.01)
    yard.edge("yard-1")
    yard.loop.run(2 * SETTLE)
    yard.bus.change(None, keys.claim("evil", TWIN, 0), True)
    yard.loop.run(4 * SETTLE)
    assert yard.running == {"yard-1"}


def test_edges_of_a_pair_claim_beside_each_other_and_keep_a_third_out(monkeypatch):
    yard = Yard(monkeypatch, lambda: 0.01)
    for name in ("yard-0", "yard-1"):
        yard.edge(name, pair=("yard-0", "yard-1"))
    yard.loop.run(2 * SETTLE)
    yard.edge("yard-2")
    yard.loop.run(6 * SETTLE)
    assert yard.running == {"yard-0", "yard-1"}, "which of them runs the robot is the lease's matter"
