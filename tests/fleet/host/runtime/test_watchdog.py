"""The watchdog: its rules by hand, and then against loops that are really stuck."""

import asyncio
import socket
import subprocess
import sys
import threading
import time

import pytest

from fleet.clock import SystemClock
from fleet.host.runtime.loop_monitor import LoopMonitor
from fleet.host.runtime.threads import NAME
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.host.runtime.watchdog import BLOCKED, PERIOD, STUCK, LoopWatch, Watchdog, WatchedRobot
from fleet.host.safety.deadman import DeadMan
from fleet.link.url import open_link
from fleet.runtime.event_loop import OWNER
from fleet.testing.clock import ManualClock


class Watch:
    """A watchdog that the test makes look, and a loop that beats when the test says so."""

    def __init__(self):
        self.clock = ManualClock()
        self.beat = self.clock.monotonic()
        self.cpu = self.waited = 0.0
        self.who = "rex"
        self.events = []
        self.dog = Watchdog(
            self.clock,
            LoopWatch(
                beat=lambda: self.beat,
                cpu=lambda: self.cpu,
                waited=lambda: self.waited,
                running=lambda: self.who,
                blocked=lambda name, seconds: self.events.append(("blocked", name)),
                stuck=lambda name: self.events.append(("stuck", name)),
            ),
        )

    def robot(self, name, *, raises=False):
        def halt():
            self.events.append(("halt", name))
            if raises:
                raise ZeroDivisionError("oops")

        deadman = DeadMan()
        self.dog.add(name, WatchedRobot(deadman, halt, lambda: self.events.append(("expired", name))))
        return deadman

    def looks(self, seconds, *, every=PERIOD, beats=False, cpu=0.0, waited=0.0):
        """Let time pass, with a look every so often."""
        for _ in range(round(seconds / every)):
            self.clock.advance(every)
            self.cpu += cpu * every
            self.waited += waited * every
            if beats:
                self.beat = self.clock.monotonic()
            self.dog.check(self.clock.monotonic())
        join_aside()


def join_aside():
    """Wait for what the watchdog tells on threads of its own."""
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join()


def test_what_is_read_has_just_come_while_the_process_is_awake():
    watch = Watch()
    assert watch.dog.arrival() == watch.clock.monotonic()
    watch.looks(1.0, beats=True)
    watch.clock.advance(PERIOD)
    assert watch.dog.arrival() == watch.clock.monotonic()


@pytest.mark.parametrize("awake", [0.0, PERIOD, 0.5])
def test_what_is_read_after_a_sleep_of_the_process_may_have_come_when_it_began(awake):
    watch = Watch()
    watch.looks(1.0, beats=True)
    began = watch.clock.monotonic()
    watch.clock.advance(3.0)
    watch.looks(awake, beats=True)
    assert watch.dog.arrival() == began


def test_some_time_after_a_sleep_what_is_read_is_new_again():
    watch = Watch()
    watch.looks(1.0, beats=True)
    watch.clock.advance(3.0)
    watch.looks(1.1, beats=True)
    assert watch.dog.arrival() == watch.clock.monotonic()


@pytest.fixture
def watch():
    watch = Watch()
    watch.looks(0.1, beats=True)
    return watch


def test_a_velocity_ends_within_a_look_of_its_lease(watch):
    watch.robot("rex").feed(watch.clock.monotonic(), 0.5)
    watch.looks(0.48, beats=True)
    assert watch.events == []
    watch.looks(2 * PERIOD, beats=True)
    assert watch.events == [("halt", "rex"), ("expired", "rex")]


def test_the_watchdog_sleeps_to_the_end_of_the_first_lease_and_no_longer_than_its_period(watch):
    now = watch.clock.monotonic()
    assert watch.dog.check(now) == PERIOD
    watch.robot("later").feed(now, 5.0)
    assert watch.dog.check(now) == PERIOD
    watch.robot("rex").feed(now, 0.007)
    assert watch.dog.check(now) == pytest.approx(0.007)
    assert 0 < watch.dog.check(now + 1.0) < 0.002
    assert watch.dog.check(now + 1.0) == PERIOD


def test_a_halt_that_raises_does_not_keep_the_others_from_theirs(watch):
    for name in ("bad", "good"):
        watch.robot(name, raises=name == "bad").feed(watch.clock.monotonic(), 0.2)
    watch.looks(0.4, beats=True)
    assert watch.events == [("halt", "bad"), ("expired", "bad"), ("halt", "good"), ("expired", "good")]


def test_a_loop_that_is_silent_is_reported_once_with_who_runs(watch):
    watch.looks(3 * BLOCKED)
    assert watch.events == [("blocked", "rex")]


def test_each_block_is_reported(watch):
    for _ in range(3):
        watch.looks(2 * BLOCKED)
        watch.looks(0.1, beats=True)
    assert watch.events == [("blocked", "rex")] * 3


def test_a_block_by_nobody_known_is_the_hosts(watch):
    watch.who = ""
    watch.looks(2 * BLOCKED)
    assert watch.events == [("blocked", "the host")]


def test_a_process_that_did_not_get_the_processor_blames_nobody(watch):
    watch.looks(5.0, every=5.0)
    watch.looks(0.1, beats=True)
    watch.looks(4 * BLOCKED, every=BLOCKED)
    assert watch.events == []


def test_a_loop_that_the_computer_gives_no_processor_blames_no_robot_though_others_look(watch):
    watch.looks(4 * BLOCKED, waited=1.0)
    assert watch.events == []


def test_a_robot_that_blocks_the_loop_on_a_busy_computer_is_still_named(watch):
    watch.looks(4 * BLOCKED, waited=0.5)
    assert watch.events == [("blocked", "rex")]


def test_a_process_that_slept_for_an_hour_is_not_given_up(watch):
    watch.looks(3600.0, every=3600.0)
    assert watch.events == []


def test_a_call_that_keeps_the_interpreter_to_itself_is_reported(watch):
    watch.looks(1.0, every=1.0, cpu=1.0)
    assert watch.events == [("blocked", "rex")]


def test_a_loop_that_is_stuck_for_long_is_given_up_after_every_robot_was_halted(watch):
    watch.robot("bad", raises=True)
    watch.robot("good")
    watch.looks(STUCK + 2 * PERIOD)
    assert watch.events.index(("halt", "good")) < watch.events.index(("stuck", "rex"))
    assert ("halt", "bad") in watch.events


@pytest.mark.parametrize("part", ["beat", "cpu", "waited", "running"])
def test_nothing_that_fails_keeps_the_watchdog_from_the_next_look(watch, part):
    def fail():
        raise RuntimeError(part)

    parts = dict.fromkeys(("beat", "cpu", "waited"), lambda: 0.0) | dict.fromkeys(
        ("running", "blocked", "stuck"), str
    )
    dog = Watchdog(watch.clock, LoopWatch(**(parts | {part: fail})))
    events = []
    deadman = DeadMan()
    dog.add("rex", WatchedRobot(deadman, lambda: events.append("halt"), lambda: None))
    dog.check(watch.clock.monotonic())
    deadman.feed(watch.clock.monotonic(), 0.1)
    watch.clock.advance(1)
    dog.check(watch.clock.monotonic())
    join_aside()
    assert events == ["halt"]


def test_a_robot_whose_place_another_takes_is_watched_no_more(watch):
    watch.robot("rex").feed(watch.clock.monotonic(), 0.1)
    watch.dog.add("rex", WatchedRobot(DeadMan(), lambda: watch.events.append("halt"), lambda: None))
    watch.looks(0.5, beats=True)
    assert watch.events == []


def test_a_robot_that_drives_when_its_watch_begins_is_stopped_when_its_lease_ends(watch):
    deadman = DeadMan()
    deadman.feed(watch.clock.monotonic(), 0.2)
    watch.dog.add("rex", WatchedRobot(deadman, lambda: watch.events.append("halt"), lambda: None))
    watch.looks(0.3, beats=True)
    join_aside()
    assert watch.events == ["halt"]


# -- real loops, really stuck -------------------------------------------------------------------------------


class Stuck:
    """A real loop with its scheduler and its watchdog; ``halts`` are the times of the halts of rex."""

    def __init__(self):
        self.scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
        self.thread = LoopMonitor(asyncio.get_running_loop())
        self.deadman = DeadMan()
        self.halts, self.blamed, self.places = [], [], []
        self.reported, self.halted = threading.Event(), threading.Event()
        self.dog = Watchdog(
            SystemClock(),
            LoopWatch(
                beat=lambda: self.scheduler.beat,
                cpu=self.thread.cpu,
                waited=self.thread.waited,
                running=lambda: self.scheduler.owner or self.thread.owner(),
                blocked=self.blocked,
                stuck=lambda name: None,
            ),
        )
        self.dog.add("rex", WatchedRobot(self.deadman, self.halt, lambda: None))

    def halt(self):
        self.halts.append(time.monotonic())
        self.halted.set()

    def blocked(self, name, seconds):
        self.places.append(self.thread.place())
        self.blamed.append(name)
        self.reported.set()


@pytest.fixture
async def stuck():
    stuck = Stuck()
    stuck.scheduler.start()
    stuck.dog.start()
    await asyncio.sleep(0.05)
    yield stuck
    stuck.dog.stop()
    stuck.scheduler.stop()
    join_aside()


def sleep(until):
    while not until.is_set():
        time.sleep(0.02)


def spin(until):
    while not until.is_set():
        pass


def let(until, block):
    """Return what blocks its caller until an event is set, at the longest 20 s."""

    def run():
        timer = threading.Timer(20, until.set)
        timer.start()
        block(until)
        timer.cancel()

    return run


@pytest.mark.parametrize("block", [sleep, spin])
async def test_a_velocity_ends_in_time_while_the_loop_is_stuck(stuck, block):
    lease = 0.3
    stuck.deadman.feed(time.monotonic(), lease)
    began = time.monotonic()
    let(stuck.halted, block)()
    (halted,) = stuck.halts
    assert lease - 0.01 <= halted - began < 5.0, "0.3 s on a quiet machine, while the loop is stuck"


def as_robot(call):
    """Make a call as rex's."""
    token = OWNER.set("rex")
    try:
        return call()
    finally:
        OWNER.reset(token)


async def in_a_task(stuck, block):
    async def work():
        block()

    await as_robot(lambda: asyncio.create_task(work()))


async def in_a_child_of_a_task(stuck, block):
    async def child():
        block()

    async def work():
        await asyncio.create_task(child())

    await as_robot(lambda: asyncio.create_task(work()))


async def in_a_wheel_call(stuck, block):
    done = asyncio.Event()

    def call():
        if not done.is_set():
            done.set()
            block()

    stuck.scheduler.every(0.02, call, owner="rex", failed=print)
    await done.wait()


async def in_a_timer(stuck, block):
    done = asyncio.Event()
    as_robot(lambda: asyncio.get_running_loop().call_later(0.01, lambda: (block(), done.set())))
    await done.wait()


async def in_a_link_callback(stuck, block):
    done = asyncio.Event()

    def received(data, address):
        block()
        done.set()

    token = OWNER.set("rex")
    link = await open_link("udpin:127.0.0.1:0", received)
    OWNER.reset(token)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"x", ("127.0.0.1", int(link.url.rpartition(":")[2])))
    await done.wait()
    await link.close()


@pytest.mark.parametrize("block", [sleep, spin])
@pytest.mark.parametrize(
    "place", [in_a_task, in_a_child_of_a_task, in_a_wheel_call, in_a_timer, in_a_link_callback]
)
async def test_who_blocks_the_loop_is_named_wherever_he_does_it(stuck, place, block):
    await asyncio.wait_for(place(stuck, let(stuck.reported, block)), 60)
    await asyncio.to_thread(join_aside)
    assert stuck.blamed == ["rex"]
    assert "test_watchdog.py" in stuck.places[0]


async def test_a_log_that_is_stuck_does_not_stop_the_watchdog(stuck):
    def held_up(name, seconds):
        stuck.reported.wait(20)

    dog = Watchdog(
        SystemClock(),
        LoopWatch(
            beat=lambda: time.monotonic() - 1.0,
            cpu=time.monotonic,
            waited=lambda: 0.0,
            running=lambda: "rex",
            blocked=held_up,
            stuck=lambda name: None,
        ),
    )
    halted = threading.Event()
    deadman = DeadMan()
    dog.add("rex", WatchedRobot(deadman, halted.set, lambda: None))
    dog.start()
    await asyncio.sleep(0.1)
    deadman.feed(time.monotonic(), 0.05)
    assert await asyncio.to_thread(halted.wait, 20)
    stuck.reported.set()
    dog.stop()


def test_a_look_that_fails_is_not_the_last(monkeypatch):
    dog = Watchdog(
        SystemClock(),
        LoopWatch(
            beat=time.monotonic,
            cpu=time.monotonic,
            waited=lambda: 0.0,
            running=lambda: "",
            blocked=lambda name, seconds: None,
            stuck=lambda name: None,
        ),
    )
    failed, halted, deadman = threading.Event(), threading.Event(), DeadMan()
    look = dog.check

    def fail_once(now):
        if not failed.is_set():
            failed.set()
            raise RuntimeError("Set changed size during iteration")
        return look(now)

    monkeypatch.setattr(dog, "check", fail_once)
    dog.add("rex", WatchedRobot(deadman, halted.set, lambda: None))
    dog.start()
    assert failed.wait(20)
    deadman.feed(time.monotonic(), 0.05)
    assert halted.wait(20)
    dog.stop()


def test_a_halt_that_is_held_up_does_not_keep_the_others_moving(watch):
    free, deadman = threading.Event(), DeadMan()
    watch.dog.add("bad", WatchedRobot(deadman, free.wait, lambda: None))
    for one in (deadman, watch.robot("good")):
        one.feed(watch.clock.monotonic(), 0.2)
    watch.clock.advance(0.2)
    watch.dog.check(watch.clock.monotonic())
    assert watch.events == [("halt", "good"), ("expired", "good")]
    free.set()
    join_aside()


GIVEN_UP = """
import asyncio, sys, time
from unittest.mock import Mock
from fleet.clock import SystemClock
from fleet.host.runtime import watchdog
from fleet.host.process.robot_process import RobotProcess
from fleet.host.runtime.watchdog import WatchedRobot
from fleet.host.safety.deadman import DeadMan

watchdog.STUCK = 0.5

async def main():
    process = RobotProcess("yard", Mock(), [], journal=Mock(), history=Mock(), clock=SystemClock())
    for name in ("a", "b"):
        process.watchdog.add(name, WatchedRobot(DeadMan(), lambda n=name: print("halt", n, flush=True), int))
    process.start()
    await asyncio.sleep(0.1)
    time.sleep(20)

asyncio.run(main())
"""


def test_a_process_whose_loop_is_stuck_ends_after_all_its_robots_were_halted():
    began = time.monotonic()
    command = [sys.executable, "-c", GIVEN_UP]
    result = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    assert result.returncode == 70
    assert result.stdout.split() == ["halt", "a", "halt", "b"]
    assert "stuck" in result.stderr
    assert time.monotonic() - began < 15
