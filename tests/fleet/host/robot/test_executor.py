"""Commands on adapters that behave badly."""

import asyncio
import sys

import pytest

from fleet.commands import command, commands_of
from fleet.errors import Refused, TimedOut
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.executor import AT_ONCE, Executor, may_still_move
from fleet.model.command import Command, ReplyStatus
from fleet.model.navigation import Progress


class Rude:
    """An adapter whose commands do what they should not."""

    def __init__(self):
        self.go = asyncio.Event()
        self.closed = False
        self.cleaned_up = []
        self.looks = 0

    @command("wait")
    async def wait(self):
        await self.go.wait()

    @command("deaf", timeout=0.01)
    async def deaf(self):
        while not self.go.is_set():
            try:
                await self.go.wait()
            except asyncio.CancelledError:
                continue

    @command("steps")
    async def steps(self):
        try:
            yield Progress(1)
            yield Progress(2)
            await self.go.wait()
        finally:
            self.closed = True

    @command("stray")
    async def stray(self):
        raise asyncio.CancelledError

    @command("look", moves=False)
    async def look(self):
        self.looks += 1
        await self.go.wait()

    @command("slow", timeout=0.01)
    async def slow(self):
        await self.go.wait()

    @command("late")
    async def late(self):
        raise TimeoutError

    @command("leaves")
    async def leaves(self):
        sys.exit(3)

    @command("mumbles", moves=False)
    async def mumbles(self):
        return object()

    @command("breaks_off")
    async def breaks_off(self):
        try:
            await self.go.wait()
        finally:
            raise Refused("while it was cancelled")


class Bench:
    def __init__(self):
        self.rude, self.crashes, self.failed = Rude(), [], []
        self.executor = Executor(crashed=self.crashes.append, journal=RobotJournal())

    def start(self, name):
        answers = []
        receipt = Receipt(name, answers.append, waits=True)
        spec = commands_of(Rude)[name]
        self.executor.start(self.rude, spec, Command(name), receipt, failed=lambda: self.failed.append(name))
        return answers


@pytest.fixture
async def rude():
    bench = Bench()
    yield bench
    bench.rude.go.set()
    await asyncio.sleep(0)


async def test_a_command_that_is_superseded_before_it_began_is_answered(rude, requests):
    first = rude.start("wait")
    rude.start("steps")
    await requests.settle()
    assert [answer.reason for answer in first] == ["superseded by steps"]


def looks_at_once(rude, *before):
    """Start commands from the loop, then ``look``; return whether it has begun before the loop goes on."""
    result = asyncio.get_running_loop().create_future()

    def begin():
        for name in (*before, "look"):
            rude.start(name)
        result.set_result(rude.rude.looks == 1)

    asyncio.get_running_loop().call_soon(begin)
    return result


async def test_a_command_without_motion_begins_before_the_loop_goes_on(rude):
    assert await looks_at_once(rude)


async def test_no_command_overtakes_one_that_has_not_begun(rude):
    assert not await looks_at_once(rude, "wait")


async def test_an_answer_that_cannot_be_said_is_a_failure_that_the_asker_hears(rude, requests):
    answers = rude.start("mumbles")
    await requests.settle()
    assert "the adapter failed: TypeError" in answers[0].reason
    assert [type(crash) for crash in rude.crashes] == [TypeError]


async def test_a_command_that_is_superseded_as_it_ends_has_one_answer(rude, requests):
    first = rude.start("wait")
    await requests.settle()
    rude.rude.go.set()
    rude.executor.cancel("stopped")
    await requests.settle()
    assert [answer.reason for answer in first] == ["stopped"]


async def test_the_sender_of_an_unanswered_command_gets_a_reply_when_its_time_is_over(rude, requests):
    answers = rude.start("deaf")
    await requests.until(lambda: answers)
    assert answers[0].status is ReplyStatus.TIMEOUT
    assert rude.executor.moving == ""
    assert rude.failed == ["deaf"]


async def test_a_deaf_command_can_be_superseded(rude, requests):
    first = rude.start("deaf")
    await requests.settle()
    rude.executor.cancel("stopped")
    assert [answer.reason for answer in first] == ["stopped"]
    assert rude.executor.moving == ""


async def test_a_command_that_goes_on_after_its_end_is_a_crash(rude, requests, monkeypatch):
    monkeypatch.setattr("fleet.host.runtime.cancellation.IGNORED_AFTER", 0.01)
    rude.start("deaf")
    await requests.settle()
    rude.executor.cancel("stopped")
    await requests.until(lambda: rude.crashes)
    assert str(rude.crashes[0]) == "command:deaf goes on though it was ended (stopped)"


async def test_a_command_that_ends_when_it_is_cancelled_is_no_crash(rude, requests, monkeypatch):
    monkeypatch.setattr("fleet.host.runtime.cancellation.IGNORED_AFTER", 0.5)
    rude.start("wait")
    await requests.settle()
    rude.executor.cancel("stopped")
    await asyncio.sleep(0.6)
    assert rude.crashes == []


async def test_a_command_that_calls_sys_exit_ends_nothing_but_itself(rude, requests):
    answers = rude.start("leaves")
    await requests.settle()
    assert "sys.exit(3)" in answers[0].reason
    assert len(rude.crashes) == 1


async def test_a_command_that_is_cancelled_half_way_is_cleaned_up(rude, requests):
    answers = rude.start("steps")
    await requests.settle()
    rude.executor.cancel("stopped")
    await requests.settle()
    assert rude.rude.closed
    assert [(answer.ok, answer.done) for answer in answers] == [(True, None), (False, False)]


async def test_a_command_that_cancels_itself_is_a_crash_and_is_answered(rude, requests):
    answers = rude.start("stray")
    await requests.settle()
    assert [answer.status for answer in answers] == [ReplyStatus.REJECTED]
    assert [type(crash) for crash in rude.crashes] == [RuntimeError]


async def test_a_command_that_fails_while_it_is_ended_says_nothing_more(rude, requests):
    answers = rude.start("breaks_off")
    await requests.settle()
    rude.executor.cancel("stopped")
    await requests.settle()
    assert [answer.reason for answer in answers] == ["stopped"]
    assert (rude.failed, rude.crashes) == ([], [])


async def test_a_time_out_of_the_robots_own_is_no_crash(rude, requests):
    answers = rude.start("late")
    await requests.settle()
    assert answers[0].status is ReplyStatus.TIMEOUT
    assert (rude.failed, rude.crashes) == (["late"], [])


async def test_a_command_that_was_superseded_is_not_a_failure(rude, requests):
    rude.start("wait")
    await requests.settle()
    rude.executor.cancel("stopped")
    await requests.settle()
    assert rude.failed == []


async def test_too_many_at_once_are_refused(rude, requests):
    answers = [rude.start("look") for _ in range(AT_ONCE + 3)]
    await requests.settle()
    refused = [one for one in answers if one and not one[0].ok]
    assert len(refused) == 3


async def test_nothing_is_left_when_all_have_ended(rude, requests):
    for name in ("wait", "look", "steps", "stray", "late"):
        rude.start(name)
    rude.rude.go.set()
    await requests.settle()
    assert rude.executor._tasks == set()
    assert rude.executor.moving == ""


@pytest.mark.parametrize(
    ("status", "safe", "superseding", "held"),
    [
        (ReplyStatus.DENIED, False, False, False),
        (ReplyStatus.DENIED, False, True, True),
        (ReplyStatus.DENIED, True, True, True),
        (ReplyStatus.TIMEOUT, False, False, True),
        (ReplyStatus.ACCEPTED, False, False, True),
        (ReplyStatus.ACCEPTED, True, True, False),
        (ReplyStatus.TIMEOUT, True, False, False),
    ],
)
def test_a_robot_is_held_after_a_failed_command_that_may_still_move_it(status, safe, superseding, held):
    @command("x", safe=safe)
    async def method(self):
        pass

    spec = commands_of(type("Robot", (), {"x": method}))["x"]
    receipt = Receipt("x", lambda _: None)
    {
        ReplyStatus.DENIED: lambda: receipt.fail(Refused("no")),
        ReplyStatus.TIMEOUT: lambda: receipt.fail(TimedOut("silence")),
        ReplyStatus.ACCEPTED: receipt.accept,
    }[status]()
    assert may_still_move(spec, receipt, superseding=superseding) is held
