"""A robot is brought to a standstill whatever its adapter does: stops, raises, hangs, or is cancelled."""

import asyncio
import contextlib

import pytest

from fleet.errors import LinkLost, NotReady, TimedOut
from fleet.host.requests.receipt import Receipt
from fleet.host.robot import standstill
from fleet.host.robot.standstill import answer_stop, stand_still
from fleet.host.runtime.blocking_calls import STOPPING
from fleet.model.command import ReplyStatus


class Stops:
    """An adapter that has only a stop."""

    def __init__(self, stop):
        self._stop = stop
        self.reasons = []

    async def stop(self, reason):
        self.reasons.append(reason)
        await self._stop()


async def stops():
    pass


async def hangs():
    await asyncio.Event().wait()


async def clings():
    """Ignore the cancellation, as a bare except around a blocking client does."""
    with contextlib.suppress(asyncio.CancelledError):
        await asyncio.sleep(3600)
    await asyncio.sleep(0)


async def is_cancelled_from_within():
    asyncio.current_task().cancel()
    await asyncio.sleep(0)


def raises(error):
    async def stop():
        raise error

    return stop


async def stand(stop, halts):
    adapter = Stops(stop)
    await stand_still(adapter, "stop", name="rex", halt=lambda: halts.append("halt"))
    return adapter


async def test_an_adapter_that_stops_is_not_halted():
    halts = []
    adapter = await stand(stops, halts)
    assert (adapter.reasons, halts) == (["stop"], [])


@pytest.mark.parametrize("stop", [hangs, clings])
async def test_a_robot_whose_adapter_does_not_stop_it_in_time_is_halted(stop, monkeypatch, caplog):
    monkeypatch.setattr(standstill, "STOP_TIMEOUT", 0.02)
    halts = []
    with pytest.raises(TimedOut, match=r"rex did not stop within 0\.02 s; it was halted"):
        await stand(stop, halts)
    assert halts == ["halt"]
    assert "the adapter did not stop within 0.02 s" in caplog.text


@pytest.mark.parametrize(
    "error", [NotReady("not now"), LinkLost("the line is gone"), RuntimeError("boom"), KeyError("speed")]
)
async def test_a_robot_whose_adapter_raises_is_halted_and_the_error_passed_on(error):
    halts = []
    with pytest.raises(type(error)):
        await stand(raises(error), halts)
    assert halts == ["halt"]


async def test_a_robot_whose_adapter_cancels_its_own_stop_is_halted():
    halts = []
    with pytest.raises(RuntimeError, match="cancelled from within"):
        await stand(is_cancelled_from_within, halts)
    assert halts == ["halt"]


@pytest.mark.parametrize(
    ("error", "text"), [(SystemExit(1), "called sys.exit"), (GeneratorExit(), "raised GeneratorExit")]
)
async def test_no_exception_of_an_adapter_leaves_the_robot_unhalted(error, text):
    halts = []
    with pytest.raises(RuntimeError, match=text):
        await stand(raises(error), halts)
    assert halts == ["halt"]


async def test_only_the_stop_itself_is_exempt_from_the_limit_of_blocking_calls():
    seen = []

    async def stop():
        seen.append(STOPPING.get())

    await stand(stop, [])
    assert (seen, STOPPING.get()) == ([True], False)


async def answered(standing, absence=""):
    answers, crashes = [], []
    receipt = Receipt("stop", answers.append, waits=True)
    await answer_stop(standing, receipt, absence=lambda: absence, crashed=crashes.append)
    return answers, crashes


async def test_a_stop_is_done_when_the_robot_stands():
    (answer,), crashes = await answered(stops())
    assert (answer.status, answer.done, crashes) == (ReplyStatus.ACCEPTED, True, [])


async def test_a_stop_of_a_robot_that_became_unreachable_meanwhile_is_not_done():
    (answer,), crashes = await answered(stops(), absence="the link is lost")
    assert (answer.status, answer.reason, crashes) == (ReplyStatus.REJECTED, "the link is lost", [])


@pytest.mark.parametrize(
    ("error", "status"),
    [(NotReady("it slips"), ReplyStatus.DENIED), (LinkLost("the line is gone"), ReplyStatus.TIMEOUT)],
)
async def test_a_stop_that_the_robot_refuses_fails_in_its_words(error, status):
    (answer,), crashes = await answered(raises(error)())
    assert (answer.status, answer.reason, crashes) == (status, str(error), [])


async def test_a_stop_that_crashes_the_adapter_is_refused_and_ends_its_run():
    error = RuntimeError("boom")
    (answer,), crashes = await answered(raises(error)())
    assert answer.status is ReplyStatus.REJECTED
    assert "the adapter failed: RuntimeError: boom" in answer.reason
    assert crashes == [error]
