"""The scheduler on a loop whose time the test sets: no waiting."""

import asyncio
import contextlib
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.clock import SystemClock
from fleet.host.runtime.tick_scheduler import SLICE, TICK, TickScheduler
from fleet.runtime.event_loop import OWNER, run
from fleet.testing.clock import ManualClock


class TurnedLoop:
    """The event loop as the scheduler needs it; ``turn`` begins a turn, ``step`` makes one call."""

    def __init__(self):
        self.now = 100.0
        self.next = None

    def time(self):
        return self.now

    def call_later(self, delay, call):
        self.next = call

    def call_at(self, when, call):
        self.call_later(when - self.now, call)

    def call_soon(self, call, *arguments):
        self.next = lambda: call(*arguments)

    def turn(self, seconds=TICK):
        self.now += seconds
        self.step()
        self.step()

    def step(self):
        call, self.next = self.next, None
        call()


@pytest.fixture
def loop():
    return TurnedLoop()


@pytest.fixture
def scheduler(loop):
    scheduler = TickScheduler(loop, ManualClock())
    scheduler.start()
    return scheduler


def refuse(error):
    raise AssertionError("nothing fails here") from error


def count(scheduler, period, calls, failed=refuse):
    return scheduler.every(period, lambda: calls.append(1), owner="rex", failed=failed)


def test_a_call_is_made_about_every_period(loop, scheduler):
    calls = []
    count(scheduler, 0.1, calls)
    for _ in range(502):
        loop.turn()
    assert len(calls) == 100


def test_a_period_that_is_no_multiple_of_the_tick_does_not_drift(loop, scheduler):
    calls = []
    count(scheduler, 0.033, calls)
    for _ in range(5000):
        loop.turn()
    assert len(calls) == pytest.approx(100 / 0.033, abs=1)


def test_calls_that_a_late_wheel_missed_are_not_made_up(loop, scheduler):
    calls = []
    count(scheduler, 0.1, calls)
    loop.turn(5.0)
    assert len(calls) == 1
    loop.turn()
    assert len(calls) == 1


def test_a_late_call_stays_in_step(loop, scheduler):
    times = []
    scheduler.every(1.0, lambda: times.append(loop.now), owner="rex", failed=refuse)
    loop.turn(3.5)
    for _ in range(100):
        loop.turn()
    assert times == [103.5, pytest.approx(104.0, abs=TICK), pytest.approx(105.0, abs=TICK)]


@given(st.floats(0.001, 3), st.lists(st.floats(0.001, 20), max_size=30))
def test_a_turn_makes_each_call_at_most_once(period, turns):
    loop, calls = TurnedLoop(), []
    scheduler = TickScheduler(loop, ManualClock())
    scheduler.start()
    count(scheduler, period, calls)
    for seconds in turns:
        before = len(calls)
        loop.turn(seconds)
        assert len(calls) - before <= 1


def test_a_call_can_end_itself(loop, scheduler):
    calls = []
    periodic = scheduler.every(0.02, lambda: (calls.append(1), periodic.cancel()), owner="rex", failed=refuse)
    for _ in range(10):
        loop.turn()
    assert calls == [1]


def test_a_call_that_raises_is_ended_and_reported_and_the_others_go_on(loop, scheduler):
    calls, failures = [], []
    scheduler.every(0.02, lambda: 1 / 0, owner="bad", failed=failures.append)
    count(scheduler, 0.02, calls)
    for _ in range(10):
        loop.turn()
    assert [type(failure) for failure in failures] == [ZeroDivisionError]
    assert len(calls) >= 9


def cancelled():
    raise asyncio.CancelledError


def exhausted():
    next(iter(()))


def exits():
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("bad", "why"),
    [(cancelled, "CancelledError"), (exhausted, "StopIteration"), (exits, r"sys\.exit\(3\)")],
)
def test_a_call_that_raises_what_is_no_failure_is_reported_as_one_and_the_others_go_on(
    loop, scheduler, bad, why
):
    calls, failures = [], []
    scheduler.every(0.02, bad, owner="bad", failed=failures.append)
    count(scheduler, 0.02, calls)
    for _ in range(10):
        loop.turn()
    (failure,) = failures
    with pytest.raises(RuntimeError, match=why):
        raise failure
    assert len(calls) >= 9


def test_work_of_the_host_that_fails_goes_on_and_its_first_failure_in_a_row_is_logged(
    loop, scheduler, caplog
):
    calls = []

    def fails_at_first():
        calls.append(len(calls))
        if len(calls) < 4:
            raise ValueError("not yet")

    scheduler.every(0.02, fails_at_first)
    for _ in range(10):
        loop.turn()
    assert len(calls) >= 9
    assert caplog.text.count("periodic work of the host failed") == 1


def test_a_failure_that_nobody_takes_is_logged_and_the_others_go_on(loop, scheduler, caplog):
    calls = []
    scheduler.every(0.02, lambda: 1 / 0, owner="bad", failed=refuse)
    count(scheduler, 0.02, calls)
    for _ in range(10):
        loop.turn()
    assert "a timer of bad failed" in caplog.text
    assert len(calls) >= 9


@pytest.mark.parametrize("place", ["call", "end"])
def test_what_ends_the_process_leaves_the_wheel_turning_until_it_has_ended(loop, scheduler, place):
    def interrupted():
        raise KeyboardInterrupt

    calls = []
    if place == "call":
        scheduler.every(0.02, interrupted, owner="bad", failed=refuse)
    else:
        scheduler.at_end(interrupted)
    count(scheduler, 0.02, calls)
    for _ in range(10):
        with contextlib.suppress(KeyboardInterrupt):
            loop.turn()
    assert len(calls) >= 9


def test_what_ends_a_turn_is_done_though_another_raises(loop, scheduler):
    ended = []
    scheduler.at_end(lambda: 1 / 0)
    scheduler.at_end(lambda: [ended.append(1)])
    loop.turn()
    loop.turn()
    assert ended == [1, 1]


def test_thousands_of_calls_are_each_made(loop, scheduler):
    calls = [[] for _ in range(5000)]
    for one in calls:
        count(scheduler, 0.1, one)
    for _ in range(52):
        loop.turn()
    assert {len(one) for one in calls} == {10}


@given(st.integers(1, 10**9), st.integers(1, 100))
def test_a_call_is_due_at_its_time_on_a_clock_of_whole_milliseconds(began, ticks):
    loop, done = TurnedLoop(), []
    loop.now = began / 1000
    scheduler = TickScheduler(loop, ManualClock())
    count(scheduler, ticks * TICK, done)
    scheduler.start()
    loop.now = (began + 20 * ticks) / 1000
    loop.step()
    loop.step()
    assert len(done) == 1


def test_who_is_being_called_is_known_and_nobody_between_turns(loop, scheduler):
    owners = []
    scheduler.every(0.02, lambda: owners.append(scheduler.owner), owner="rex", failed=refuse)
    loop.turn(0.03)
    assert (owners, scheduler.owner) == (["rex"], "")


def test_what_a_call_starts_belongs_to_its_robot(loop, scheduler):
    owners = []
    token = OWNER.set("rex")
    scheduler.every(0.02, lambda: owners.append(OWNER.get()), owner="rex", failed=refuse)
    OWNER.reset(token)
    loop.turn(0.03)
    assert owners == ["rex"]


def test_a_wheel_that_was_made_long_before_its_start_is_not_late(loop):
    clock = ManualClock()
    scheduler = TickScheduler(loop, clock)
    clock.advance(60)
    scheduler.start()
    assert scheduler.beat == clock.monotonic()


def test_a_long_turn_leaves_the_loop_to_others_after_each_slice(loop):
    clock, done = ManualClock(), []
    scheduler = TickScheduler(loop, clock)

    def work(name):
        done.append(name)
        clock.advance(SLICE)

    for name in ("a", "b"):
        scheduler.every(TICK, lambda name=name: work(name), owner=name, failed=refuse)
    scheduler.at_end(lambda: (work(name) for name in ("c", "d")))
    scheduler.start()
    loop.turn()
    seen = [list(done)]
    for _ in range(3):
        assert scheduler.owner == ""
        loop.step()  # others have their turn
        assert done == seen[-1]
        loop.step()
        seen.append(list(done))
    assert seen == [["a"], ["a", "b"], ["a", "b", "c"], ["a", "b", "c", "d"]]


def test_what_is_read_between_two_slices_begins_before_the_second():
    done, clock = [], SystemClock()
    near, far = socket.socketpair()

    def work(name):
        done.append(name)
        far.send(b"!") if name == "a" else None
        end = clock.monotonic() + SLICE
        while clock.monotonic() < end:
            pass

    async def obey():
        done.append("obeyed")

    async def turn_once():
        loop, ended = asyncio.get_running_loop(), asyncio.Event()
        loop.add_reader(near, lambda: (near.recv(1), loop.create_task(obey())))
        scheduler = TickScheduler(loop, clock)
        for name in ("a", "b"):
            scheduler.every(TICK, lambda name=name: work(name), owner=name, failed=refuse)
        scheduler.at_end(lambda: ["b" in done and ended.set()])
        scheduler.start()
        await asyncio.wait_for(ended.wait(), 60)
        scheduler.stop()

    with near, far:
        run(turn_once())
    assert done[:3] == ["a", "obeyed", "b"]


def test_a_wheel_that_is_stopped_by_one_of_its_calls_makes_no_other(loop):
    clock, done = ManualClock(), []
    scheduler = TickScheduler(loop, clock)
    scheduler.every(TICK, lambda: (scheduler.stop(), clock.advance(SLICE)), owner="a", failed=refuse)
    count(scheduler, TICK, done)
    scheduler.start()
    loop.turn()
    assert done == []
    assert loop.next is None


async def test_it_turns_on_a_real_loop_until_it_is_stopped():
    scheduler, turned = TickScheduler(asyncio.get_running_loop(), SystemClock()), asyncio.Event()
    scheduler.every(TICK, turned.set, owner="", failed=refuse)
    scheduler.start()
    await asyncio.wait_for(turned.wait(), 60)
    scheduler.stop()
    turned.clear()
    await asyncio.sleep(3 * TICK)
    assert not turned.is_set()
