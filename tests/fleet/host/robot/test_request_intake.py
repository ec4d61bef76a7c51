"""Messages to a robot: an emergency stop counts as soon as it is read; what waited too long moves nothing."""

import asyncio
import contextvars
import json
import threading
from types import SimpleNamespace

import pytest

from fleet.host.requests.history_recorder import HistoryRecorder
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.request_intake import RequestIntake
from fleet.model.command import Transport
from fleet.model.event import Requester

POSITION = {"command": "goto", "action_id": "a1", "position": [1, 2, 3]}


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Wait for an emergency halt to be written, on however busy a machine."""
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)


@pytest.fixture
async def door(bench):
    """Return an intake in front of a robot in memory, with what it published, recorded and changed."""
    published, recorded, changed = [], [], []
    intake = RequestIntake(
        bench.config,
        bench.controller,
        clock=bench.clock,
        publish=published.append,
        changed=changed.append,
        recorder=HistoryRecorder(recorded.append, bench.clock),
        arrival=bench.clock.monotonic,
        home_altitude=lambda: None,
        context=contextvars.copy_context(),
    )

    def read(kind, payload, transport=Transport.CLOUD, **more):
        if isinstance(payload, dict):
            payload = json.dumps({"source_type": "tele", "session_id": "anna", **payload}).encode()
        return intake.read(kind, payload, transport=transport, **more)

    def submit(request):
        answers = []
        request(answers.append)
        return answers

    return SimpleNamespace(
        intake=intake, read=read, submit=submit, published=published, recorded=recorded, changed=changed
    )


async def test_an_emergency_stop_is_set_and_halts_by_the_thread_that_reads_it(door, bench):
    reader = threading.Thread(target=door.read, args=("command", {"command": "emergency_stop"}))
    reader.start()
    reader.join()  # the loop takes nothing meanwhile
    assert bench.controller.latched
    assert bench.adapter.calls == ["halt"]
    assert [event.command for event in door.recorded] == ["emergency_stop"]


async def test_an_emergency_stop_that_fails_at_once_is_recorded_and_still_obeyed_by_the_loop(
    door, bench, requests, monkeypatch, caplog
):
    def fails(_why):
        raise OSError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(bench.controller, "emergency", fails)
        request = door.read("command", {"command": "emergency_stop"})
    assert "the emergency stop did not go through at once" in caplog.text
    assert [event.command for event in door.recorded] == ["emergency_stop"]
    door.submit(request)
    await requests.settle()
    assert bench.controller.latched
    assert "stop" in bench.adapter.calls


@pytest.mark.parametrize(
    "payload",
    [b"{", b"stop", b'{"command": "stop"}', b'{"command": "land", "data": "emergency_stop"}'],
)
async def test_nothing_else_is_taken_for_an_emergency_stop(door, bench, payload):
    door.read("command", payload)
    assert not bench.controller.latched
    assert bench.adapter.calls == []


async def test_a_command_that_must_not_be_read_is_an_emergency_stop_with_the_reason_in_its_answer(
    door, bench, requests, caplog
):
    answers = door.submit(door.read("command", {"command": "takeoff"}, unread="it is too long"))
    await requests.settle()
    assert bench.controller.latched
    assert [(answer.ok, answer.reason) for answer in answers] == [
        (True, "taken for emergency_stop, though the message was refused: it is too long")
    ]
    assert "took a message that was refused for emergency_stop: it is too long" in caplog.text


@pytest.mark.parametrize(
    ("message", "longest"),
    [
        (("motion", {"linear_x": 1.0}), 0.5),
        (("command", {"command": "move_forward"}), 0.5),
        (("command", {"command": "takeoff"}), 5.0),
        (("navigate", POSITION), 5.0),
    ],
)
async def test_what_moves_the_robot_is_refused_once_it_has_waited_too_long(
    door, bench, requests, message, longest
):
    request = door.read(*message)
    bench.clock.advance(longest + 0.01)
    (answer,) = door.submit(request)
    assert answer.reason == f"it waited up to {longest:.1f} s: the edge was held up"
    assert not bench.controller.in_motion
    assert not door.intake.in_use
    request = door.read(*message)
    bench.clock.advance(longest - 0.01)
    answers = door.submit(request)
    await requests.settle()
    assert [answer.ok for answer in answers] == [True]
    assert bench.controller.in_motion


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("command", {"command": "stop"}),
        ("command", {"command": "emergency_stop"}),
        ("command", {"command": "hover"}),
        ("navigate", {"command": "stop"}),
        ("motion", {"linear_x": 0.0}),
    ],
)
async def test_what_ends_motion_is_obeyed_however_long_it_waited(door, bench, requests, kind, message):
    door.submit(door.read("motion", {"linear_x": 1.0}))
    assert bench.controller.in_motion
    request = door.read(kind, message)
    bench.clock.advance(3600.0)
    answers = door.submit(request)
    await requests.settle()
    assert [answer.ok for answer in answers] == [True]
    assert not bench.controller.in_motion


@pytest.mark.parametrize(
    ("kind", "message", "step"),
    [("navigate", POSITION, None), ("mission", {"command": "start", "mission_execution_uuid": "a1"}, 0)],
)
async def test_a_goal_or_a_mission_that_is_refused_here_fails_under_its_id(door, bench, kind, message, step):
    bad = door.read(kind, json.dumps({**message, "position": "nowhere", "mission": []}).encode())
    (answer,) = door.submit(bad)
    (status,) = door.published
    assert (status.action_id, status.state, status.step) == ("a1", "failed", step)
    assert status.message == answer.reason != ""
    assert not answer.ok


async def test_a_goal_that_waited_too_long_fails_under_its_id(door, bench):
    request = door.read("navigate", POSITION)
    bench.clock.advance(60.0)
    (answer,) = door.submit(request)
    (status,) = door.published
    assert (status.action_id, status.state, status.message) == ("a1", "failed", answer.reason)


async def test_a_command_that_cannot_be_read_is_refused_and_recorded_without_a_status(door):
    (answer,) = door.submit(door.read("command", b"{", request_id="r1"))
    assert not answer.ok
    assert door.published == []
    assert [(event.kind, event.command) for event in door.recorded] == [("command", "command")]


async def test_a_robot_is_in_use_from_what_moves_it_on(door, bench, requests):
    for message in ({"command": "battery_check"}, {"command": "no_such"}, {"command": "stop"}):
        door.submit(door.read("command", message))
        await requests.settle()
        assert not door.intake.in_use
    door.submit(door.read("motion", {"linear_x": 1.0}))
    assert door.intake.in_use
    door.submit(door.read("command", {"command": "stop"}))
    await requests.settle()
    assert door.intake.in_use, "nobody else has taken it since"


async def test_a_stop_that_came_by_no_message_is_followed_on_the_loop(door, bench, requests):
    door.submit(door.read("motion", {"linear_x": 1.0}))
    bench.controller.emergency("the stop key")
    cause = StopCause(Requester(Transport.BUS), "the stop key", "r1")
    await asyncio.to_thread(door.intake.follow_emergency, cause)
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert door.changed == ["rex"]
    assert [event.text for event in door.recorded if event.kind == "stop"] == [
        "emergency_stop asked: the stop key"
    ]


async def test_a_stop_that_is_released_before_the_loop_follows_it_is_set_again_with_its_whole_cause(
    door, bench, requests
):
    cause = StopCause(Requester(Transport.BUS, "anna"), "smoke", "r1")
    bench.controller.emergency(cause.sentence)
    bench.controller.latch.release()
    door.intake.follow_emergency(cause)
    await requests.settle()
    assert bench.controller.latch.cause == "asked by anna (claimed, over the bus): smoke"
