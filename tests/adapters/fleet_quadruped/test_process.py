"""The body controller as a process: how it is started, what its messages mean, and how it is dismissed."""

import asyncio
import contextlib
import os
import signal
import socket
from types import SimpleNamespace

import msgspec
import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped import process as module
from fleet_quadruped.control.orders import DogState, Order
from fleet_quadruped.control.task import ControlTask
from fleet_quadruped.process import DISMISSED, BodyProcess
from fleet_quadruped.robot.description import EXAMPLE
from tests.adapters.fleet_quadruped.conftest import config

KILLED = -signal.SIGKILL


class Stdin:
    """A pipe to a process, which leaves when it is dismissed if it is ``obedient``."""

    def __init__(self, process):
        self._process, self.written, self.closed = process, b"", False

    def is_closing(self):
        return self.closed

    def write(self, data):
        self.written += data

    def close(self):
        self.closed = True
        if self._process.obedient:
            self._process.end(0)


class Child:
    """A process that a test has say and do what it wants."""

    pid = 4711

    def __init__(self):
        self.obedient, self.returncode, self.gone = True, None, False
        self.stdin, self.stdout = Stdin(self), asyncio.StreamReader()
        self._ended = asyncio.Event()

    def say(self, **message):
        self.stdout.feed_data(msgspec.json.encode(message) + b"\n")
        return self

    def end(self, status):
        self.returncode = status
        self.stdout.feed_eof()
        self._ended.set()

    async def wait(self):
        await self._ended.wait()
        return self.returncode

    def kill(self):
        if not self._ended.is_set():
            self.end(KILLED)
        if self.gone:
            raise ProcessLookupError


@pytest.fixture
async def started(monkeypatch):
    """Return how the process is started: its arguments, and the child that a test may change before."""
    found = SimpleNamespace(child=Child(), arguments=(), options={})

    async def start(*arguments, **options):
        found.arguments, found.options = arguments, options
        return found.child

    monkeypatch.setattr(module.asyncio, "create_subprocess_exec", start)
    return found


@pytest.fixture
def make():
    return lambda leave=5.0, relay=None, **changes: BodyProcess(config(**changes), leave, relay)


def plan_of(started):
    return msgspec.json.decode(started.arguments[-1], type=ControlTask)


def are_closed(descriptors):
    for descriptor in descriptors:
        with pytest.raises(OSError):
            os.fstat(descriptor)
    return True


async def test_it_is_started_with_its_plan_and_the_shared_memory(started, make, tmp_path):
    started.child.say(ready=True)
    async with make(link="sim:kinematic?faults=loss:0.05,mute:3", captures=tmp_path / "c") as process:
        plan, shared = plan_of(started), started.options["pass_fds"]
        assert (plan.body, plan.sim, plan.buses) == (str(EXAMPLE), "kinematic", {})
        assert plan.faults == {"loss": 0.05, "mute": 3.0}
        assert (plan.captures, plan.relay) == (str(tmp_path / "c"), -1)
        assert [plan.order, plan.state] == shared
        assert started.options["start_new_session"], "Ctrl-C is for the edge"
        assert (process.pid, process.states.get(), process.orders.get()) == (4711, DogState(), Order())


async def test_a_real_dog_has_its_buses_and_no_simulation(started, make):
    started.child.say(ready=True)
    async with make(link=None, buses={"a": "can:socketcan:can0"}):
        plan = plan_of(started)
    assert (plan.sim, plan.faults, plan.buses) == ("", {}, {"a": "can:socketcan:can0"})


async def test_the_socket_for_recorded_frames_is_passed_on(started, make):
    started.child.say(ready=True)
    ours, relay = socket.socketpair()
    with ours, relay:
        async with make(relay=relay):
            assert started.options["pass_fds"][-1] == plan_of(started).relay == relay.fileno()


@pytest.mark.parametrize(
    ("message", "error", "expected"),
    [
        ({"refused": "RL_hip: another make of drive"}, LinkRefused, "RL_hip: another make of drive"),
        ({"lost": "RL_hip: id 8 is silent"}, LinkLost, "RL_hip: id 8 is silent"),
        ({}, LinkLost, "the body controller ended"),
    ],
)
async def test_one_that_does_not_become_ready_says_why(started, make, message, error, expected):
    started.child.say(**message)
    process = make()
    with pytest.raises(error, match=f"^{expected}$"):
        await process.__aenter__()
    assert started.child.stdin.closed
    assert are_closed(started.options["pass_fds"])


async def test_one_that_ends_without_a_word_is_lost_with_its_status(started, make):
    started.child.end(-11)
    with pytest.raises(LinkLost, match=r"^the body controller ended with status -11$"):
        await make().__aenter__()


async def test_one_that_is_never_ready_is_dismissed(started, make, monkeypatch):
    monkeypatch.setattr(module, "_START", 0.01)
    with pytest.raises(LinkLost, match=r"^the body controller was not ready within 0\.01 s$"):
        await make().__aenter__()
    assert started.child.stdin.written == DISMISSED
    assert are_closed(started.options["pass_fds"])


async def test_one_that_cannot_be_started_leaves_no_descriptors(make, monkeypatch):
    process = make()
    descriptors = list(process._descriptors)
    monkeypatch.setattr(module.sys, "executable", "/nowhere/python")
    with pytest.raises(FileNotFoundError):
        await process.__aenter__()
    assert are_closed(descriptors)


async def test_it_is_dismissed_with_a_word_before_its_pipe_is_closed(started, make):
    started.child.say(ready=True)
    async with make():
        assert started.child.stdin.written == b""
    assert (started.child.stdin.written, started.child.stdin.closed) == (b"leave\n", True)
    assert started.child.returncode == 0
    assert are_closed(started.options["pass_fds"])


async def test_one_that_died_is_not_written_to(started, make):
    started.child.say(ready=True)
    async with make():
        started.child.stdin.closed = True
        started.child.end(1)
    assert started.child.stdin.written == b""


async def test_one_that_does_not_leave_in_its_time_is_killed(started, make):
    started.child.say(ready=True)
    started.child.obedient = False
    async with make(leave=0.01):
        pass
    assert started.child.returncode == KILLED


async def test_one_that_is_gone_before_it_is_killed_is_no_error(started, make):
    started.child.say(ready=True)
    started.child.obedient, started.child.gone = False, True
    async with make(leave=0.0):
        pass


async def test_a_cancellation_waits_until_the_dog_has_sat_down(started, make):
    started.child.say(ready=True)
    started.child.obedient = False

    async def leave():
        async with make(leave=60.0):
            pass

    leaving = asyncio.create_task(leave())
    while not started.child.stdin.closed:  # noqa: ASYNC110 - the child sets no event
        await asyncio.sleep(0)  # until it has begun to leave
    for _ in range(2):
        leaving.cancel()
        for _ in range(5):
            await asyncio.sleep(0)
        assert not leaving.done()
    started.child.end(0)
    with pytest.raises(asyncio.CancelledError):
        await leaving
    assert (started.child.returncode, are_closed(started.options["pass_fds"])) == (0, True)


@pytest.mark.parametrize(
    ("message", "error"),
    [({"lost": "the bus is gone"}, LinkLost), ({"refused": "the bus is gone"}, LinkRefused)],
)
async def test_its_end_is_told_in_its_last_words(started, make, message, error):
    started.child.say(ready=True)
    async with make() as process:
        ended = asyncio.create_task(process.ended())
        await asyncio.sleep(0)
        assert not ended.done()
        started.child.say(**message)
        with pytest.raises(error, match=r"^the bus is gone$"):
            await ended


async def test_an_error_in_the_block_is_raised_after_the_dog_has_sat_down(started, make):
    started.child.say(ready=True)
    with contextlib.suppress(KeyError):
        async with make():
            raise KeyError
    assert started.child.stdin.written == DISMISSED
