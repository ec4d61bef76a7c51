"""The subprocess of a simulator, as those who ask it see it: its answers, its silence, and its end."""

import asyncio
import json
import sys

import msgspec
import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet.sim.process import _START, _STOP, SimProcess
from fleet.testing.clock import JumpingLoop

URL = {"url": "toy:a"}


class Subprocess:
    """A subprocess that answers each line with the next of its answers; None: it says nothing."""

    def __init__(self, *answers, obeys=True):
        self.stdin = self.stdout = self
        self.answers, self.lines, self.obeys = list(answers), [], obeys
        self.ended, self.status, self.killed, self.closing, self.broken = (
            asyncio.Event(),
            0,
            False,
            False,
            None,
        )

    def write(self, data):
        assert data.endswith(b"\n")
        self.lines.append(msgspec.json.decode(data))

    async def drain(self):
        if self.broken:
            raise self.broken

    async def readline(self):
        answer = self.answers.pop(0)
        if answer is None:
            await asyncio.Event().wait()
        await asyncio.sleep(0)
        return answer if isinstance(answer, bytes) else json.dumps(answer).encode() + b"\n"

    def close(self):
        self.closing = True
        if self.obeys:
            self.ends(0)

    def is_closing(self):
        return self.closing

    def ends(self, status):
        self.status = status
        self.ended.set()

    async def wait(self):
        await self.ended.wait()
        return self.status

    def kill(self):
        self.killed = True
        self.ends(-9)


def simulated(work, monkeypatch, **given):
    """Return what ``work(simulator, process)`` returns, the process, and the seconds that all took."""

    async def whole():
        process, started = Subprocess(*given.pop("answers", ()), **given), []

        async def start(*command, **how):
            started.append((command, how))
            return process

        monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
        began = asyncio.get_running_loop().time()
        async with SimProcess("fleet_toy.sim") as simulator:
            found = await work(simulator, process)
        process.started = started
        return found, process, asyncio.get_running_loop().time() - began

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


async def nothing(_simulator, _process):
    pass


def test_it_is_a_module_that_reads_lines_and_does_not_hear_the_terminals_ctrl_c(monkeypatch):
    _, process, took = simulated(nothing, monkeypatch)
    ((command, how),) = process.started
    assert command == (sys.executable, "-m", "fleet_toy.sim", "--stdin")
    assert how["start_new_session"]
    assert (process.closing, process.killed, took) == (True, False, 0.0)


def test_one_that_does_not_end_with_its_input_is_killed(monkeypatch):
    _, process, took = simulated(nothing, monkeypatch, obeys=False)
    assert (process.killed, took) == (True, pytest.approx(_STOP))


def test_one_that_cannot_be_started_is_a_link_that_is_refused(monkeypatch):
    async def fail(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    async def work():
        monkeypatch.setattr(asyncio, "create_subprocess_exec", fail)
        async with SimProcess("toys"):
            pass

    with pytest.raises(LinkRefused, match=r"the simulator cannot be started: .*temporarily unavailable"):
        asyncio.run(work())


def test_a_robot_is_there_for_the_time_of_its_block(monkeypatch):
    async def work(simulator, process):
        async with simulator.robot({"name": "a"}) as url:
            await simulator.fault(url, "loss", 0.5)
            await simulator.fault(url, "loss", None)
            before = list(process.lines)
        return url, before, process.lines[-1]

    found, _, _ = simulated(work, monkeypatch, answers=[URL, {}, {}, {}])
    faults = [{"fault": {**URL, "name": "loss", "value": value}} for value in (0.5, None)]
    assert found == ("toy:a", [{"add": {"name": "a"}}, *faults], {"remove": URL})


@pytest.mark.parametrize("answer", [{"error": "it is gone"}, b""])
def test_a_robot_that_cannot_be_removed_any_more_is_no_error_of_its_user(monkeypatch, answer):
    async def work(simulator, process):
        async with simulator.robot({}):
            process.ends(1)
        return True

    assert simulated(work, monkeypatch, answers=[URL, answer])[0]


def test_what_the_simulator_refuses_is_a_link_that_is_refused(monkeypatch):
    async def work(simulator, _process):
        with pytest.raises(LinkRefused, match="the simulator refuses: there is no fault slip"):
            await simulator.request({})
        return await simulator.request({})

    assert simulated(work, monkeypatch, answers=[{"error": "there is no fault slip"}, {"x": 1}])[0] == {
        "x": 1
    }


def test_requests_of_several_are_answered_each_with_its_own(monkeypatch):
    async def work(simulator, _process):
        return await asyncio.gather(*(simulator.request({"look": each}) for each in range(3)))

    found, process, _ = simulated(work, monkeypatch, answers=[{"x": each} for each in range(3)])
    assert found == [{"x": 0}, {"x": 1}, {"x": 2}]
    assert process.lines == [{"look": 0}, {"look": 1}, {"look": 2}]


@pytest.mark.parametrize("patience", [1.0, 2 * _START])
def test_an_answer_that_nobody_waits_for_any_more_is_not_that_of_the_next(monkeypatch, patience):
    """A robot whose connection is broken off must not leave its link to another one."""

    async def work(simulator, process):
        process.stdout = asyncio.StreamReader()
        with pytest.raises((TimeoutError, LinkLost)):
            async with asyncio.timeout(patience):
                await simulator.request({"add": {"name": "a"}})
        process.stdout.feed_data(b'{"url": "toy:a"}\n')
        asyncio.get_running_loop().call_later(1.0, process.stdout.feed_data, b'{"url": "toy:b"}\n')
        return await simulator.request({"add": {"name": "b"}})

    assert simulated(work, monkeypatch)[0] == {"url": "toy:b"}


def test_one_that_says_nothing_for_long_is_lost(monkeypatch):
    async def work(simulator, _process):
        with pytest.raises(LinkLost, match=f"the simulator does not answer within {_START:g} s"):
            await simulator.request({})

    _, _, took = simulated(work, monkeypatch, answers=[None])
    assert took == pytest.approx(_START)


@pytest.mark.parametrize("how", ["its output ends", "its input is closed", "its input breaks"])
def test_one_that_has_ended_is_lost_with_its_status(monkeypatch, how):
    async def work(simulator, process):
        process.ends(-11)
        process.closing = how == "its input is closed"
        process.broken = BrokenPipeError("Broken pipe") if how == "its input breaks" else None
        why = "does not answer: Broken pipe" if process.broken else "ended with status -11"
        with pytest.raises(LinkLost, match=f"the simulator {why}"):
            await simulator.request({})
        return process.lines

    lines = simulated(work, monkeypatch, answers=[b""])[0]
    assert lines == [] if how == "its input is closed" else lines == [{}]


def test_who_waits_for_its_end_hears_of_it(monkeypatch):
    async def work(simulator, process):
        asyncio.get_running_loop().call_later(5.0, process.ends, -9)
        with pytest.raises(LinkLost, match="the simulator ended with status -9"):
            await simulator.lost()

    assert simulated(work, monkeypatch)[2] == 5.0


@pytest.mark.parametrize("ask", [lambda one: one.request({}), lambda one: one.lost()])
async def test_one_that_was_not_started_is_not_there(ask):
    with pytest.raises(LinkLost, match="the simulator is not running"):
        await ask(SimProcess("toys"))
