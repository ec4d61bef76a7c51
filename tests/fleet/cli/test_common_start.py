"""``--at``: what the command line itself finds before anybody is prepared."""

import json
import time

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.command import Reply, ReplyStatus
from fleet.model.common_start import CLOCKS_WITHIN, ClockOffset, StartAnswer, offset_of


@pytest.fixture
def yard(play_edge):
    """Play an edge with two robots, whose process tells a time that is ``ahead`` of ours."""

    class Yard:
        def __init__(self):
            self.played = play_edge(
                "yard-1", robots={"rex": {}, "beast": {}}, groups={"all": ["rex", "beast"]}
            )
            self.requested = []
            self.ahead = 0.0
            control = self.played.bus.control
            control.declare_queryable(keys.starts("yard-1"), self.tell)
            for name in ("rex", "beast"):
                control.declare_queryable(keys.prepare("yard-1", name), self.prepare)

        def tell(self, question):
            answer = StartAnswer("main", time.time() + self.ahead)
            question.reply(msgspec.json.encode(answer))
            question.close()

        def prepare(self, question):
            self.requested.append(question)
            question.reply(msgspec.json.encode(Reply("walk", ReplyStatus.REJECTED, "busy with goto")))
            question.close()

    return Yard()


@pytest.mark.parametrize("ahead", [0.3, -0.3])
def test_a_process_whose_clock_is_not_ours_starts_nobody(fleet, yard, ahead):
    yard.ahead = ahead
    result = fleet("send", "all", "walk", "--at", "+3s")
    assert result.code == 5
    assert f"the clock of edge yard-1 is {ahead * 1000:+.0f}"[:34] in result.err
    assert "synchronise the clocks" in result.err
    assert yard.requested == []


def test_a_process_that_does_not_tell_its_time_starts_nobody(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {}})
    result = fleet("send", "rex", "walk", "--at", "+20s")
    assert (result.code, "edge yard-1 does not report its time" in result.err) == (5, True)


def test_every_robot_has_its_line_when_nobody_is_started(fleet, yard):
    result = fleet("send", "all", "walk", "--at", "+3s")
    assert result.code == 5
    assert sorted(result.out.splitlines()) == [
        "beast: walk rejected: busy with goto",
        "rex: walk rejected: busy with goto",
    ]
    assert "no robot is started: rex: busy with goto" in result.err
    message = json.loads(yard.requested[0].payload)
    assert (message["command"], yard.requested[0].parameters["kind"]) == ("walk", "command")


@pytest.mark.parametrize("at", ["2s", "+0.1s", "+11min", "-5s", "+nan", "soon", "2020-01-01T00:00:00Z", ""])
def test_an_instant_that_is_none_or_not_ahead_is_a_usage_error(fleet, yard, at):
    result = fleet("send", "all", "walk", f"--at={at}")
    assert (result.code, yard.requested) == (2, [])


def test_an_offset_is_known_as_well_as_the_question_was_fast():
    assert offset_of(10.0, 10.3, 10.2) == ClockOffset(pytest.approx(0.2), pytest.approx(0.1))
    assert ClockOffset(-0.2, 0.1).worst == pytest.approx(0.3)
    assert offset_of(10.0, 10.001, 10.002).worst < CLOCKS_WITHIN
