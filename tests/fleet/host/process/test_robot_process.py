"""Robots in one process: who blocks it, who is halted, and how it ends."""

import asyncio
import json
import logging
import math
import threading
import time
from functools import partial
from types import SimpleNamespace

import pytest
from cyberwave.data.header import HeaderTemplate

from fleet.host.logs.line_format import JsonFormatter
from fleet.host.logs.rotating_file import RotatingLogFile
from fleet.host.process.adapter_runs import AdapterRuns
from fleet.host.process.setpoints import receive_setpoint
from fleet.host.requests.receipt import Receipt
from fleet.host.requests.stop_cause import local_cause
from fleet.host.runtime.watchdog import BLOCKED
from fleet.model.command import Transport
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import BatteryReport, PoseReport, TelemetryReport
from fleet.testing.clock import ManualClock

HERE = {"worker": "main"}


@pytest.fixture
async def served(yard, run_edge, requests):
    """Run two robots in this process; gives the process and the yard."""
    place = yard(rex=HERE, max=HERE)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        await asyncio.sleep(0.1)
        yield edge.process, place


def block(seconds):
    time.sleep(seconds)


def block_as(process, name):
    """Return a future that is done when a robot has blocked the loop once."""
    done = asyncio.get_running_loop().create_future()

    async def work():
        block(1.5 * BLOCKED)
        done.set_result(None)

    process.robots[name]._context.run(lambda: asyncio.ensure_future(work()))
    return done


async def test_a_robot_that_blocks_the_loop_is_named_with_the_place_and_no_other(served, requests):
    process, _ = served
    await block_as(process, "rex")
    await requests.until(lambda: process.robots["rex"].state().health == "degraded")
    cause = process.robots["rex"].state().cause
    assert cause.startswith("blocked the event loop at test_robot_process.py:")
    assert cause.endswith("in block")
    assert process.robots["max"].state().health == "ok"


async def test_a_third_block_in_a_minute_is_a_quarantine_with_the_advice_of_a_worker(served, requests):
    process, place = served
    failures = process.robots["rex"].runner._failures
    for _ in range(20):  # on a busy machine the watchdog is late too, and then blames nobody
        if not failures.exceeded and "quarantined" not in process.robots["rex"].state().cause:
            await block_as(process, "rex")
            await asyncio.sleep(0.1)
    await requests.until(lambda: "quarantined" in process.robots["rex"].state().cause)
    assert "worker: rex" in process.robots["rex"].state().cause
    assert place.words("max") == ["run"]


async def test_a_block_of_the_hosts_own_blames_no_robot(served, caplog):
    process, _ = served
    with caplog.at_level(logging.ERROR):
        for _ in range(10):  # on a busy machine the watchdog is late too, and then blames nobody
            block(1.5 * BLOCKED)
            await asyncio.sleep(0.1)
            if caplog.text:
                break
    assert "the host blocks the event loop" in caplog.text
    assert {robot.state().health for robot in process.robots.values()} == {"ok"}


async def test_a_process_that_gives_itself_up_has_its_last_words_in_the_log_file(
    served, tmp_path, monkeypatch
):
    process, _ = served
    path, found = tmp_path / "main.jsonl", []
    monkeypatch.setattr("fleet.host.process.robot_process.FLUSH_TIMEOUT", 20.0)
    monkeypatch.setattr("os._exit", lambda code: found.append((code, path.read_text())))
    logging.getLogger().addHandler(file := RotatingLogFile(path, JsonFormatter()))
    try:
        await asyncio.to_thread(process._stuck, "rex")
    finally:
        logging.getLogger().removeHandler(file)
        file.close()
    ((code, written),) = found
    assert code == 70
    assert "the event loop is stuck in rex: this process ends now" in written


async def test_a_robot_that_comes_and_goes_begins_and_ends_its_telemetry(served):
    process, _ = served
    robot, said = process.robots["rex"], []
    robot._send = said.append
    for offline in ("gone", "", ""):
        robot.controller.attached.offline = offline
        robot._health_changed()
    types = [report.type for report in said if isinstance(report, TelemetryReport)]
    assert types == ["disconnected", "telemetry_end", "connected", "telemetry_start"]


async def test_a_stop_for_all_is_not_held_up_by_one_whose_halt_hangs(served, requests):
    process, place = served
    free = threading.Event()
    held = []
    process.robots["rex"].controller.attached.adapter.halt = lambda: held.append(free.wait(20))
    stopped = await asyncio.to_thread(process.stop_robots, (), local_cause("", "test"))
    assert stopped == ["rex", "max"]
    await requests.until(lambda: "halt" in place.words("max"))
    assert all(robot.controller.latched for robot in process.robots.values())
    await requests.until(lambda: "stop" in place.words("rex"))
    assert held == []
    free.set()
    await requests.until(lambda: held == [True, True])


async def test_all_are_latched_before_the_first_is_halted(served, requests):
    process, _ = served
    latched = []
    process.robots["rex"].controller.attached.adapter.halt = lambda: latched.append(
        process.robots["max"].controller.latched
    )
    await asyncio.to_thread(process.stop_robots, (), local_cause("", "test"))
    await requests.until(lambda: latched)
    assert latched[0]


async def test_a_halt_that_hangs_keeps_nobody_from_reading_the_stop_of_another(served, requests):
    process, place = served
    free, held = threading.Event(), []
    process.robots["rex"].controller.attached.adapter.halt = lambda: held.append(free.wait(20))
    for name in ("rex", "max"):
        process.robots[name].read("command", b'{"command": "emergency_stop"}', transport=Transport.CLOUD)
        assert process.robots[name].controller.latched
    await requests.until(lambda: "halt" in place.words("max"))
    assert held == []
    free.set()
    await requests.until(lambda: held == [True])


@pytest.mark.parametrize("bad", [math.nan, math.inf])
async def test_a_pose_that_is_no_place_keeps_no_robot_in_its_fence(yard, run_edge, requests, bad):
    corners = [[-5, -5], [5, -5], [5, 5], [-5, 5]]
    place = yard(rex={"worker": "main", "fence": {"frame": "world", "inclusion": [corners]}})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
        robot = edge.process.robots["rex"]
        for x, expected in ((bad, "the robot's position is unknown"), (1.0, "")):
            robot.publish(PoseReport(edge.process.clock.time(), Vector3(x), Quaternion()))
            answers = []
            robot.read("command", b'{"command": "move_forward"}', transport=Transport.BUS)(answers.append)
            assert (answers[0].ok, expected in answers[0].reason) == (not expected, True)


async def test_a_stop_is_noted_before_the_robots_are_looked_up(served):
    """A robot that is added in between looks for the stop after it can be found."""
    seen = []

    class Robots(dict):
        def values(self):
            seen.append("looked up")
            return super().values()

    process, _ = served
    process.stop_requested = lambda names, cause: seen.append((names, cause.sentence))
    process.robots = Robots(process.robots)
    process.stop_robots(("rex",), local_cause("", "test"))
    assert seen[:2] == [(("rex",), "test"), "looked up"]


async def test_robots_are_stopped_though_their_stop_could_not_be_noted(served, requests, caplog):
    process, place = served
    process.stop_requested = lambda _names, _cause: 1 / 0
    assert process.stop_robots(("max",), local_cause("", "test")) == ["max"]
    await requests.until(lambda: "stop" in place.words("max"))
    assert "a stop was not noted for the robots that join" in caplog.text


async def test_a_stop_for_one_touches_no_other(served, requests):
    process, place = served
    assert process.stop_robots(("max", "nobody"), local_cause("", "test")) == ["max"]
    await requests.until(lambda: "stop" in place.words("max"))
    assert place.words("rex") == ["run"]


async def test_a_command_for_an_offline_robot_is_refused_with_the_cause(served, requests):
    process, _ = served
    robot = process.robots["rex"]
    robot.controller.lost("no heartbeat for 3 s")
    answers = []
    robot.read("command", b'{"command": "hang"}', transport=Transport.BUS)(answers.append)
    assert answers[0].reason == "rex is offline: no heartbeat for 3 s"


async def test_what_cannot_be_read_is_refused_with_the_reason(served):
    process, _ = served
    answers = []
    process.robots["rex"].read("command", b"{", transport=Transport.BUS)(answers.append)
    assert [answer.ok for answer in answers] == [False]


async def test_an_emergency_stop_halts_before_the_loop_takes_it(served, requests):
    process, place = served
    process.robots["rex"].read("command", b'{"command": "emergency_stop"}', transport=Transport.CLOUD)
    assert process.robots["rex"].controller.latched
    await requests.until(lambda: place.words("rex") == ["run", "halt"])


@pytest.mark.parametrize(
    "payload", [b"{", b"stop", b'{"command": "land", "data": {"x": "stop"}}', b"\xff stop"]
)
async def test_what_is_no_emergency_stop_is_not_taken_for_one(served, payload):
    process, _ = served
    process.robots["rex"].read("command", payload, transport=Transport.CLOUD)
    assert not process.robots["rex"].controller.latched


async def test_a_recorded_velocity_that_is_played_on_the_bus_moves_nothing_and_is_reported(
    served, requests, caplog
):
    process, place = served
    arrived = partial(receive_setpoint, process.robots["rex"], "motion", process.loop)
    sample = HeaderTemplate("application/json")
    arrived(sample.pack(b'{"linear_x": 0.2}', ts=time.time() - 60))
    await requests.until(lambda: "refused a setpoint of the bus" in caplog.text)
    assert not any("drive" in word for word in place.words("rex"))
    arrived(sample.pack(b'{"linear_x": 0.2}'))
    await requests.until(lambda: "drive:0.2" in place.words("rex"))


def watching():
    return "fleet-watchdog" in {thread.name for thread in threading.enumerate()}


@pytest.fixture
async def ending(yard, monkeypatch):
    """Give an edge, and a list that says, once it has ended, whether the watchdog watched to the last."""
    edge, watched = yard(rex=HERE).edge(), []
    close = edge.process.journal.close
    monkeypatch.setattr(edge.process.journal, "close", lambda: (watched.append(watching()), close()))
    yield edge, watched
    edge.process.watchdog.stop()


async def test_a_journal_that_takes_long_to_close_is_not_taken_for_a_stuck_loop(ending, run_edge, requests):
    edge, watched = ending
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
    assert watched == [False]


@pytest.mark.parametrize(
    ("kind", "message", "waited", "taken"),
    [
        ("motion", {"linear_x": 1.0}, 0.4, True),
        ("motion", {"linear_x": 1.0}, 0.6, False),
        ("command", {"command": "restart_adapter"}, 0.6, True),
        ("command", {"command": "restart_adapter"}, 5.5, False),
        ("command", {"command": "stop"}, 9.0, True),
    ],
)
async def test_what_waited_too_long_for_the_loop_is_refused_but_a_stop(served, kind, message, waited, taken):
    process, _ = served
    robot = process.robots["rex"]
    answers = []
    request = robot.read(kind, json.dumps(message).encode(), transport=Transport.BUS)
    robot.requests._clock = ManualClock(monotonic=robot.clock.monotonic() + waited)
    request(answers.append)
    late = [answer for answer in answers if "held up" in answer.reason]
    assert bool(late) is not taken


async def test_what_the_battery_made_us_do_is_the_robots_health_with_its_cause(yard, run_edge, requests):
    place = yard(rex={**HERE, "battery_policy": {"action": "stop"}})
    edge = place.edge()
    async with run_edge(edge):
        robot = edge.process.robots["rex"]
        await requests.until(lambda: robot.state().health == "ok")
        robot.controller.receive(requests.setpoint(source="tele"), Receipt("move", lambda _: None))
        robot.publish(BatteryReport(0.0, 18.0))
        await requests.until(lambda: "stop" in place.words("rex"))
        state = robot.state()
        assert (state.health, state.cause) == ("degraded", "stop by battery_policy: the battery was at 18 %")
        await requests.until(lambda: "rex degraded: stop by battery_policy" in edge.state().cause)


MISSPELT = [
    ("command", {"command": "move_forward", "source_type": "tele", "data": {"linear_xx": 0.1}}),
    ("command", {"command": "move_forward", "source_type": "tele", "data": {"distnce": 0.1}}),
    ("motion", {"source_type": "tele", "linear": {"x": 0.1}, "anguler": {"z": 0.3}}),
    (
        "navigate",
        {"command": "goto", "source_type": "tele", "position": [1, 2, 0], "constraints": {"max_sped_ms": 1}},
    ),
]


@pytest.mark.parametrize(("kind", "message"), MISSPELT)
@pytest.mark.parametrize("transport", list(Transport))
async def test_misspelt_data_moves_nothing_by_any_way_in(served, requests, kind, message, transport):
    process, place = served
    answers = []
    request = process.robots["rex"].read(kind, json.dumps(message).encode(), transport=transport)
    request(answers.append)
    await requests.settle()
    assert [answer.ok for answer in answers] == [False]
    assert "did you mean" in answers[0].reason
    assert not any(word.startswith(("drive", "navigate")) for word in place.words("rex"))


@pytest.mark.parametrize(
    ("kind", "payload", "state"),
    [
        ("navigate", b'{"command": "goto", "action_id": "a-7", "position": [NaN, 2, 3]}', "a-7"),
        ("navigate", b'{"command": "goto", "action_id": "a-7", "position": [1e999, 2, 3]}', "a-7"),
        ("navigate", b'{"command": "goto", "action_id": "a-7", "position": [1, 2], "position": 1}', "a-7"),
        (
            "navigate",
            b'{"command": "goto", "action_id": "a-7", "position": [1, 2, 3], "twin_uuid": "x"}',
            "a-7",
        ),
        ("mission", b'{"command": "start", "mission_execution_uuid": "m-1", "mission": NaN}', "m-1"),
    ],
)
async def test_a_goal_that_cannot_be_read_has_a_failed_status_under_its_id(served, kind, payload, state):
    process, _ = served
    robot, reports = process.robots["rex"], []
    robot.requests._publish = reports.append
    answers = []
    robot.read(kind, payload, transport=Transport.CLOUD)(answers.append)
    (status,) = reports
    assert (status.action_id, status.state, status.message) == (state, "failed", answers[0].reason)


@pytest.mark.parametrize(
    ("kind", "message", "why"),
    [
        ("command", {"command": "strafe_left"}, "it does not move sideways"),
        ("command", {"command": "strafe_right", "data": {"linear_y": 0.2}}, "it does not move sideways"),
        (
            "command",
            {"command": "move", "data": {"linear_x": 0.3, "linear_y": 0.2}},
            "it does not move sideways",
        ),
        ("command", {"command": "strafe_left", "data": {"distance": 1}}, "it does not move sideways"),
        ("command", {"command": "ascend"}, "it stays on the ground"),
        ("command", {"command": "descend", "data": {"linear_z": 0.2}}, "it stays on the ground"),
        ("command", {"command": "ascend", "data": {"distance": 1}}, "it stays on the ground"),
        ("motion", {"linear": {"x": 0.3, "y": 0.2}}, "it does not move sideways"),
        ("motion", {"linear": {"z": 0.2}}, "it stays on the ground"),
    ],
)
async def test_a_way_that_the_robot_cannot_go_is_refused_and_not_accepted(
    served, requests, kind, message, why
):
    process, place = served
    answers = []
    payload = json.dumps({"source_type": "tele", **message}).encode()
    process.robots["rex"].read(kind, payload, transport=Transport.CLOUD)(answers.append)
    await requests.settle()
    assert [answer.ok for answer in answers] == [False]
    assert why in answers[0].reason
    assert not any(word.startswith("drive") for word in place.words("rex"))


async def test_later_verbs_have_the_speed_that_was_set_until_a_stop(served, requests):
    process, place = served

    async def request(command, **data):
        answers = []
        message = {"command": command, "source_type": "tele", "session_id": "anna", "data": data}
        process.robots["rex"].read("command", json.dumps(message).encode(), transport=Transport.CLOUD)(
            answers.append
        )
        await requests.settle()
        return answers[0]

    echo = await request("set_linear_velocity", linear=0.25)
    assert (echo.ok, echo.data) == (True, {"linear": 0.25})
    assert "drive" not in "".join(place.words("rex"))
    await request("move_forward")
    await request("move_backward", linear_x=0.1)
    await request("stop")
    await request("move_forward")
    drives = [word for word in place.words("rex") if word.startswith("drive") and word != "drive:0"]
    assert drives == ["drive:0.25", "drive:-0.1", "drive:0.5"]


async def test_runs_have_not_ended_while_an_adapter_ignores_its_end(caplog):
    deaf = asyncio.get_running_loop().create_future()
    robots = [
        SimpleNamespace(name=name, runner=SimpleNamespace(leftover=left))
        for name, left in (("rex", deaf), ("max", None))
    ]
    ended = asyncio.ensure_future(AdapterRuns(lambda _: None).all_ended(robots))
    await asyncio.wait({ended}, timeout=0.02)
    assert not ended.done()
    assert "the adapters of rex do not end" in caplog.text
    deaf.set_result(None)
    await asyncio.wait_for(ended, 60.0)
