"""The keeper on its thread, with a store in memory that can be silent."""

import asyncio
import time

import pytest

from fleet.errors import StateError
from fleet.standby.keeper import LeaseKeeper
from fleet.standby.lease import Lease, LeaseState, LeaseTimes
from tests.tools.waiting import wait_until

TERMS = LeaseTimes(length=0.9, renewed_every=0.1, standstill=0.3, margin=0.05)


class Store:
    """One lease in memory; ``silent``: no request is answered."""

    def __init__(self):
        self.entry, self.revision, self.silent = None, 0, False

    async def read(self):
        await self._answer()
        return self.entry, self.revision

    async def write(self, entry, revision):
        await self._answer()
        if revision != self.revision:
            return None
        self.entry, self.revision = entry, self.revision + 1
        return self.revision

    async def _answer(self):
        if self.silent:
            raise StateError("the lease service does not answer")
        await asyncio.sleep(0)

    async def close(self):
        pass


class User:
    """What runs the robots: it lets go of them at once, unless told otherwise."""

    def __init__(self):
        self.states, self.vouchers, self.seen, self.stopped = [], [], [], {}

    def stops(self):
        return dict(self.stopped)

    def permit_writes(self, epoch, until):
        assert self.states[-1:] in ([], [LeaseState.STANDBY]) or epoch == self.vouchers[-1][0]
        self.vouchers.append((epoch, until))

    def changed(self, state):
        self.states.append(state)

    def saw(self, entry):
        self.seen.append(entry)


@pytest.fixture
def keep():
    """Return what begins keepers; they are closed at the end."""
    begun = []

    def begin(edge, store):
        keeper = LeaseKeeper(Lease(edge, f"{edge}-1", TERMS), store, User(), clock=time.monotonic)
        keeper.begin()
        begun.append(keeper)
        return keeper

    yield begin
    for keeper in begun:
        keeper.close()


def holds(keeper):
    return keeper.lease.state is LeaseState.HOLDER


def test_the_links_are_vouched_for_before_the_robots_are_run(keep):
    keeper = keep("a", Store())
    wait_until("the lease is held", lambda: keeper._user.states == [LeaseState.HOLDER])
    assert keeper._user.vouchers[0][0] == keeper.lease.epoch == 1


def test_the_lease_is_kept_though_its_user_fails_now_and_then(keep, monkeypatch, caplog):
    keeper = keep("a", Store())
    wait_until("the lease is held", lambda: holds(keeper))
    failed, stops = [], keeper._user.stops

    def fail():
        failed.append(1)
        if len(failed) < 3:
            raise RuntimeError("dictionary changed size during iteration")
        return stops()

    monkeypatch.setattr(keeper._user, "stops", fail)
    before = len(keeper._user.vouchers)
    wait_until("it is renewed", lambda: len(failed) > 3 and len(keeper._user.vouchers) > before)
    assert "it is tried again" in caplog.text


def test_a_holder_that_ends_gives_the_lease_to_the_other_at_once(keep):
    store = Store()
    a = keep("a", store)
    wait_until("a holds the lease", lambda: holds(a))
    b = keep("b", store)
    wait_until("b has seen a's lease", lambda: b._user.seen)
    a.close()
    assert store.entry.released or store.entry.edge == "b"
    wait_until("b holds it", lambda: holds(b))
    assert b.lease.takeover.orderly


def test_a_lease_that_cannot_be_renewed_ends_and_is_reported(keep):
    store = Store()
    keeper = keep("a", store)
    wait_until("the lease is held", lambda: holds(keeper))
    store.silent = True
    wait_until("it ends", lambda: keeper._user.states[-1] is LeaseState.FENCED)
    assert time.monotonic() < keeper._user.vouchers[-1][1] + 60
    assert keeper.problem == "the lease service does not answer"
    keeper.robots_released()
    wait_until("it waits", lambda: keeper._user.states[-1] is LeaseState.STANDBY)
    store.silent = False
    wait_until(
        "it takes a new epoch", lambda: holds(keeper) and len({e for e, _ in keeper._user.vouchers}) == 2
    )


def test_a_stop_is_in_the_store_long_before_the_next_renewal(keep):
    store = Store()
    keeper = keep("a", store)
    wait_until("the lease is held", lambda: holds(keeper))
    keeper._user.stopped["rover"] = "asked by anna"
    wait_until("the store has it", lambda: store.entry.stops == {"rover": "asked by anna"})


def test_a_handover_waits_until_the_robots_are_let_go_of(keep):
    store = Store()
    a = keep("a", store)
    wait_until("a holds the lease", lambda: holds(a))
    b = keep("b", store)
    a.hand_over("b")
    wait_until("a ends its motion", lambda: a._user.states[-1] is LeaseState.FENCED)
    assert not store.entry.released
    a.robots_released()
    wait_until("b holds it", lambda: holds(b))
    assert not holds(a)
