"""Halts through the adapter of a run: they raise nothing, hold nobody up, and claim no more than is known."""

import threading

import pytest

from fleet.errors import LinkLost, NotReady
from fleet.model.command import ReplyStatus
from fleet.wire.stops import STOP_WORDS

ACCEPTED, REJECTED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for an emergency halt to be written, on however busy a machine."""
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)


def statuses(answers):
    return [answer.status for answer in answers]


@pytest.mark.parametrize("method", ["emergency", "halt"])
async def test_a_halt_that_raises_stays_inside(bench, requests, method):
    bench.adapter.halts = ZeroDivisionError("oops")
    {"emergency": lambda: bench.controller.emergency("test"), "halt": bench.controller.halt}[method]()
    bench.request(requests.command("stop"))
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"


@pytest.mark.parametrize("reachable", [True, False])
async def test_an_emergency_halt_that_hangs_keeps_neither_the_latch_nor_the_loop(
    bench, requests, reachable, monkeypatch
):
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 0.01)
    free, held = threading.Event(), []
    bench.adapter.emergency_halt = bench.adapter.halt = lambda: held.append(free.wait(20))
    if not reachable:
        bench.controller.lost("no heartbeat")
    answers = bench.request(requests.command("emergency_stop"))
    assert bench.controller.latched
    await requests.settle()
    assert held == []
    assert bench.adapter.calls == ["stop"] * reachable
    assert statuses(answers) == [ACCEPTED if reachable else REJECTED]
    free.set()
    await requests.until(lambda: len(held) == (1 if reachable else 2))


def refusing(error):
    """Return a ``halt_unheard`` that raises."""

    def halt_unheard(reason):
        raise error

    return halt_unheard


@pytest.mark.parametrize(
    ("halt_unheard", "expected"),
    [
        (lambda _: True, "the stop was written, but the robot does not answer"),
        (lambda _: False, "the stop was given to its adapter, which does not know whether it was written"),
        (refusing(LinkLost("the cable is out")), "the stop was not written: the cable is out"),
        (refusing(NotReady("a pilot has it")), "the stop was not written: a pilot has it"),
        (refusing(KeyError("x")), "the stop may not have been written: its adapter failed"),
    ],
    ids=["written", "unknown", "lost", "refused", "crashed"],
)
async def test_a_stop_of_a_robot_that_is_not_heard_says_no_more_than_is_true(
    bench, requests, monkeypatch, halt_unheard, expected
):
    monkeypatch.setattr(bench.adapter, "halt_unheard", halt_unheard)
    bench.controller.lost("silent")
    answers = [answer for name in STOP_WORDS for answer in bench.request(requests.command(name))]
    assert {(answer.ok, answer.reason.partition("; ")[2]) for answer in answers} == {(False, expected)}
    bench.controller.detach("the device is gone")
    (answer,) = bench.request(requests.command("stop"))
    assert answer.reason.endswith("the stop was not written: no link to it is open")


async def test_a_stop_that_a_blocked_link_has_not_taken_is_not_called_written(
    make_bench, requests, monkeypatch
):
    bench, free = make_bench(), threading.Event()
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 0.01)
    monkeypatch.setattr(bench.adapter, "halt_unheard", lambda _: free.wait(20.0))
    bench.controller.lost("silent")
    (answer,) = bench.request(requests.command("stop"))
    free.set()
    assert answer.reason.endswith("the stop may not have been written: its link has not taken it yet")
