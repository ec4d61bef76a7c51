"""Commands for video are passed on to who sends it: an edge, and programs on its bus."""

import asyncio
import json

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.process.video_relay import ANSWER_WITHIN, VideoRelay
from fleet.host.requests.receipt import Receipt
from fleet.model.command import Command, Reply, ReplyStatus
from fleet.testing.clock import ManualClock
from fleet.wire.samples import json_payload
from tests.tools.waiting import wait_until


class FakeSession:
    """A session whose programs answer when the test says so."""

    def request_later(self, key, payload, *, timeout, on_answer, on_end):
        self.requested = (key, json.loads(payload), timeout)
        self.answer, self.end = on_answer, on_end


@pytest.fixture
def bus_session():
    return FakeSession()


@pytest.fixture
async def send(bus_session, requests):
    """Ask a relay; returns the replies, the clock, and what has the loop catch up."""
    clock, replies = ManualClock(), []
    loop, key = asyncio.get_running_loop(), "fleet/yard-1/robots/rex/video"
    relay = VideoRelay("rex", key, bus_session, loop, clock, tell=lambda _reply: None)
    relay.relay(Command("start_video", {"recording": False}), Receipt("start_video", replies.append))
    return replies, clock, requests.settle


async def test_a_program_is_asked_with_the_commands_data_and_its_yes_is_the_answer(bus_session, send):
    replies, _, settle = send
    assert bus_session.requested[:2] == (
        "fleet/yard-1/robots/rex/video",
        {"command": "start_video", "data": {"recording": False}},
    )
    assert bus_session.requested[2] < 5  # what the SDK waits for an answer
    bus_session.answer(b'{"ok": true}')
    bus_session.end()
    await settle()
    assert [reply.status for reply in replies] == [ReplyStatus.ACCEPTED]


async def test_of_several_programs_one_that_does_it_is_enough(bus_session, send):
    replies, _, settle = send
    bus_session.answer(b'{"ok": false, "reason": "another sensor"}')
    bus_session.answer(b'{"ok": true}')
    bus_session.end()
    await settle()
    assert [reply.ok for reply in replies] == [True]


@pytest.mark.parametrize(
    ("answer", "waited", "expected"),
    [
        (b'{"ok": false, "reason": "no camera"}', 0.1, (ReplyStatus.DENIED, "no camera")),
        (b"what?", 0.1, (ReplyStatus.DENIED, "cannot be decoded")),
        (None, 0.1, (ReplyStatus.REJECTED, "no program on the bus sends video of rex")),
        (None, ANSWER_WITHIN, (ReplyStatus.TIMEOUT, "does not answer")),
    ],
)
async def test_a_command_that_nobody_carries_out_says_why(bus_session, send, answer, waited, expected):
    replies, clock, settle = send
    if answer is not None:
        bus_session.answer(answer)
    clock.advance(waited)
    bus_session.end()
    await settle()
    (reply,) = replies
    assert (reply.status, expected[1] in reply.reason) == (expected[0], True)


async def test_a_busy_loop_is_not_taken_for_a_program_that_is_silent(bus_session, send):
    replies, clock, settle = send
    bus_session.end()
    clock.advance(ANSWER_WITHIN)
    await settle()
    assert "no program on the bus" in replies[0].reason


@pytest.fixture
def passed_on(make_bench):
    """Make a robot that passes commands for video on; returns it and what it passed."""

    def passed_on(**config):
        bench, passed = make_bench(**config), []
        bench.controller.own["start_video"] = lambda command, receipt: (
            passed.append(command),
            receipt.done(),
        )
        return bench, passed

    return passed_on


async def test_who_may_start_video_is_said_by_the_robots_policy(passed_on, requests):
    for config, source, obeyed in (
        ({}, "tele", True),
        ({}, "edit", False),
        ({"accepts": {"command": ["edit"]}}, "tele", False),
        ({"link": "sim:puppet"}, "tele", False),
        ({"link": "sim:puppet", "accepts": {"command": ["tele"]}}, "tele", True),
    ):
        bench, passed = passed_on(**config)
        (reply,) = bench.request(requests.command("start_video", source))
        assert (reply.ok, bool(passed)) == (obeyed, obeyed), (config, source)


async def test_video_is_started_whatever_the_robot_itself_does(passed_on, requests):
    bench, passed = passed_on()
    bench.request(requests.command("emergency_stop"))
    await requests.settle()
    bench.request(requests.command("start_video"))
    bench.controller.lost("unplugged")
    bench.request(requests.command("start_video"))
    assert len(passed) == 2
    assert bench.controller.latched


async def test_a_command_for_video_that_comes_again_is_passed_on_once(passed_on, requests):
    bench, passed = passed_on()
    answers = [bench.request(requests.command("start_video", id="same"))[0].ok for _ in range(2)]
    assert (answers, len(passed)) == ([True, True], 1)


def command(bus_session, yard, name):
    """Ask the robot rex on the bus."""
    payload = json.dumps({"command": name}).encode()
    answers = bus_session.request(keys.command(yard.id, "rex"), payload, timeout=60)
    return [msgspec.json.decode(answer, type=Reply) for _, answer in answers]


@pytest.mark.parametrize("worker", ["main", "yard"])
async def test_a_program_on_the_bus_is_reached_from_the_edge_and_from_a_worker(
    yard, run_edge, requests, worker
):
    place = yard(rex={"worker": worker})
    edge = place.edge()
    heard, statuses = [], []

    def answer(question):
        heard.append(json.loads(question.payload)["command"])
        question.reply(b'{"ok": true}')
        question.close()

    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        for name in ("start_video", "stop_video"):
            key = f"cw/{edge.robots()[0].twin}/data/{name}_status"
            bus_session.subscribe(key, lambda _key, sample: statuses.append(json.loads(json_payload(sample))))

        def send(name):
            (reply,) = command(bus_session, place, name)
            return reply

        # Who publishes a status learns of our subscription later than of our command: they take two links.
        await asyncio.to_thread(wait_until, "a status", lambda: not send("start_video").ok and statuses)
        nobody = await asyncio.to_thread(send, "start_video")
        assert (nobody.ok, nobody.hint) == (False, "start one on the robot's computer: fleet video rex")
        edge.bus.control.declare_queryable(keys.video(place.id, "rex"), answer)
        await asyncio.to_thread(wait_until, "the program is known", lambda: send("start_video").ok)
        assert (await asyncio.to_thread(send, "stop_video")).ok
        await asyncio.to_thread(
            wait_until, "the last status", lambda: statuses[-1]["type"] == "video_stopped"
        )
        await asyncio.to_thread(bus_session.close)
    assert heard == ["start_video", "stop_video"]
    *errors, started, stopped = [(status["type"], status["status"]) for status in statuses]
    assert set(errors) == {("video_started", "error")}
    assert (started, stopped) == (("video_started", "ok"), ("video_stopped", "ok"))
