"""How long a loop has been silent by its own fault, and whose code it executes, seen from another thread."""

import asyncio
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.runtime import loop_monitor
from fleet.host.runtime.loop_monitor import LoopMonitor, LoopSilence
from fleet.runtime.event_loop import OWNER, FleetLoop, OwnedCall
from tests.tools.waiting import wait_until

PERIOD = 0.025
spans = st.floats(0, 2)


class Looks:
    """Looks at a loop that is silent from the first one on."""

    def __init__(self):
        self.silence = LoopSilence(PERIOD)
        self.now = self.beat = 100.0
        self.cpu = self.waited = 0.0
        self.reads = 0
        self.look(0.0)

    def read(self):
        self.reads += 1
        return self.waited

    def look(self, after=PERIOD, *, cpu=0.0, waited=0.0, beats=False):
        """Look after some seconds, in which the loop used or lacked the processor for some."""
        self.now += after
        self.cpu += cpu
        self.waited += waited
        if beats:
            self.beat = self.now
        return self.silence.update(self.now, self.beat, self.cpu, self.read)

    def looks(self, times, **each):
        for _ in range(times):
            seconds = self.look(**each)
        return seconds


@pytest.fixture
def looks():
    return Looks()


def test_a_loop_that_beats_is_not_silent(looks):
    for _ in range(10):
        assert looks.look(beats=True) == 0.0
        assert looks.silence.attributable == 0.0
    assert looks.reads == 0


def test_silence_grows_with_each_look(looks):
    assert looks.looks(4) == pytest.approx(4 * PERIOD)
    assert looks.silence.attributable == pytest.approx(4 * PERIOD)
    assert looks.look(beats=True) == 0.0, "and ends with a beat"


def test_time_in_which_this_thread_was_late_as_well_counts_as_two_periods(looks):
    looks.looks(4)
    assert looks.look(30.0) == pytest.approx(6 * PERIOD)


def test_but_not_while_the_loop_used_the_processor(looks):
    """A call that holds the interpreter lock makes this thread late."""
    assert looks.look(3.0, cpu=2.5) == 2.5
    assert looks.silence.attributable == 2.5


def test_the_processor_time_before_the_last_beat_does_not_count(looks):
    looks.look(3.0, cpu=2.5)
    looks.look(0.1, cpu=0.1, beats=True)
    assert looks.look(0.1, cpu=0.08) == pytest.approx(0.08)


def test_no_more_counts_than_has_passed_since_the_beat(looks):
    looks.now += 1.0
    looks.beat = looks.now - 0.01
    looks.look(0.0)
    assert looks.look(0.02, cpu=5.0) == pytest.approx(0.03)


def test_the_loop_is_not_to_blame_for_time_without_a_processor(looks):
    looks.looks(3)
    looks.looks(10, waited=PERIOD)
    assert looks.silence.attributable == pytest.approx(3 * PERIOD)
    looks.looks(4)
    assert looks.silence.attributable == pytest.approx(7 * PERIOD)


def test_but_for_all_of_the_processor_time_that_it_used(looks):
    looks.looks(3)
    looks.looks(10, cpu=PERIOD / 2, waited=PERIOD)
    assert looks.silence.attributable == pytest.approx(5 * PERIOD)


def test_what_it_lacked_is_read_only_once_it_is_silent_for_two_periods(looks):
    looks.looks(2, after=PERIOD * 0.99)
    assert looks.reads == 0
    looks.look()
    assert looks.reads == 1


def test_what_it_lacked_in_one_silence_does_not_excuse_the_next(looks):
    looks.looks(3)
    looks.looks(5, waited=PERIOD)
    looks.look(beats=True)
    assert looks.looks(5) == pytest.approx(5 * PERIOD)
    assert looks.silence.attributable == pytest.approx(5 * PERIOD)


@given(steps=st.lists(st.tuples(spans, st.floats(0, 1), st.floats(0, 1), st.booleans()), max_size=8))
def test_a_silence_is_never_longer_than_the_time_since_the_beat(steps):
    looks = Looks()
    for seconds, busy, idle, beats in steps:
        silent = looks.look(seconds, cpu=seconds * busy, waited=seconds * (1 - busy) * idle, beats=beats)
        assert 0.0 <= silent <= looks.now - looks.beat


# -- a real loop, stopped in the middle of a call -----------------------------------------------------------


class Stopped:
    """A loop on a thread of its own, which is held in the middle of what it executes."""

    def __init__(self):
        self.there, self.go = threading.Event(), threading.Event()
        self.loop = FleetLoop()
        self.monitor = None
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()
        assert self.there.wait(20)

    def _run(self):
        self.monitor = LoopMonitor(self.loop)
        self.loop.call_soon(self.there.set)
        self.loop.run_forever()

    def hold(self):
        """Be the code that does not return."""
        self.there.set()
        assert self.go.wait(20)

    def at(self, schedule):
        """Schedule something on the loop, and return what is seen of it while it is held."""
        self.there.clear()
        self.go.clear()
        self.loop.call_soon_threadsafe(schedule)
        assert self.there.wait(20)
        seen = self.monitor.owner(), self.monitor.place()
        self.go.set()
        return seen

    def end(self):
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(20)
        self.loop.close()


@pytest.fixture
def stopped():
    stopped = Stopped()
    yield stopped
    stopped.end()


def test_a_callback_that_belongs_to_nobody_is_the_hosts_own(stopped):
    owner, place = stopped.at(stopped.hold)
    assert owner == ""
    assert place.startswith("test_loop_monitor.py:")
    assert place.endswith(" in hold"), "not the wait within it, which is of the standard library"


def test_a_callback_of_a_robot_is_known_by_its_owner(stopped):
    assert stopped.at(OwnedCall("rex", stopped.hold))[0] == "rex"


def test_a_task_of_a_robot_is_known_by_its_owner(stopped):
    async def work():
        stopped.hold()

    def schedule():
        token = OWNER.set("ada")
        stopped.task = stopped.loop.create_task(work())
        OWNER.reset(token)

    owner, place = stopped.at(schedule)
    assert owner == "ada"
    assert place.endswith(" in hold")


def test_a_task_that_belongs_to_nobody_is_the_hosts_own(stopped):
    async def work():
        stopped.hold()

    def schedule():
        stopped.task = stopped.loop.create_task(work())

    assert stopped.at(schedule)[0] == ""


def test_a_loop_that_has_ended_is_nowhere(stopped):
    monitor = stopped.monitor
    stopped.end()
    stopped.end = lambda: None
    assert (monitor.frame(), monitor.owner(), monitor.place()) == (None, "", "an unknown place")
    # The kernel may show a thread for a moment after it was joined.
    wait_until("its thread is gone", lambda: monitor.waited() == 0.0)


async def test_the_times_of_a_thread_only_grow():
    monitor = LoopMonitor(asyncio.get_running_loop())
    cpu, waited = monitor.cpu(), monitor.waited()
    sum(range(200_000))
    assert monitor.cpu() > cpu
    assert monitor.waited() >= waited >= 0.0
    assert monitor.cpu() == pytest.approx(time.thread_time(), abs=0.5)


@pytest.mark.parametrize("text", ["", "12", "a b c"])
async def test_a_system_that_does_not_count_the_time_without_a_processor_excuses_nothing(text, monkeypatch):
    monkeypatch.setattr(loop_monitor.Path, "read_text", lambda _path: text)
    assert LoopMonitor(asyncio.get_running_loop()).waited() == 0.0


async def test_the_time_without_a_processor_is_given_in_nanoseconds_by_the_system(monkeypatch):
    monkeypatch.setattr(loop_monitor.Path, "read_text", lambda _path: "123 2500000000 7\n")
    assert LoopMonitor(asyncio.get_running_loop()).waited() == 2.5


async def test_a_system_without_clocks_of_threads_counts_no_processor_time(monkeypatch):
    monkeypatch.delattr(time, "pthread_getcpuclockid")
    assert LoopMonitor(asyncio.get_running_loop()).cpu() == 0.0
