"""A heartbeat that is absent stops robots; nothing that comes back releases them."""

import asyncio
import json
import os
import pty
import threading
import time

import pytest

from fleet.config.schema import StopInputConfig
from fleet.host.process.stop_inputs import SILENT_AFTER, HeldByEdge, StopInput, StopInputs, robots_of
from fleet.host.safety.emergency_stop import RELEASE, EmergencyStopLatch
from fleet.model.command import Transport
from fleet.testing.clock import ManualClock
from tests.tools.waiting import wait_until

HERE = {"worker": "main"}
TIMEOUT = 1.0  # s; a busy computer may keep the button's thread waiting for a part of it


class Button:
    """A device that sends a heartbeat over a pseudo terminal while it is held down."""

    def __init__(self, word=b"+"):
        self.master, slave = pty.openpty()
        self.name = os.ttyname(slave)
        self._slave = slave
        self.word = word
        self.beats = True
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended.wait(0.02):
            if self.beats:
                os.write(self.master, self.word)

    def unplug(self):
        self._ended.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self.master)


@pytest.fixture
def button():
    made = Button()
    yield made
    if not made._ended.is_set():
        made.unplug()


@pytest.fixture
def guarded(yard, run_edge, requests):
    """Return what runs two robots with stop inputs, and the edge once it answers."""

    def make(*inputs, max_worker="main"):
        place = yard(rex=HERE, max={"worker": max_worker})
        fleet = json.loads(place.file.read_text())
        place.file.write_text(json.dumps({**fleet, "stop_inputs": list(inputs)}))
        edge = place.edge()
        return place, edge, run_edge(edge)

    return make


def an_input(device, **more):
    return {"name": "button", "kind": "serial", "device": device, "timeout": TIMEOUT, **more}


def is_heard(edge):
    """Return whether the stop inputs are heard and robots reached; the edge's own cause may be another."""
    inputs = edge._stop_inputs
    held = any(latch.held for latch in inputs._here.values())
    return not inputs.problem and not held and all(state.reachable for state in edge.states())


def stopped(edge, name):
    return next(state.emergency_stop for state in edge.states() if state.name == name)


def block_until(condition):
    """Wait without giving the event loop a turn."""
    deadline = time.monotonic() + 9  # s; the watchdog ends a process whose loop is stuck for 10
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


async def requested(edge, name, command, **data):
    """Ask a robot of this process; returns its receipt."""
    answers = []
    message = {"command": command, "source_type": "tele", "data": data}
    edge.process.robots[name].read("command", json.dumps(message).encode(), transport=Transport.CLOUD)(
        answers.append
    )
    async with asyncio.timeout(60):
        while not answers:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.01)
    return answers[0]


async def test_robots_move_while_the_heartbeat_is_heard_and_are_stopped_without_it(guarded, button, requests):
    place, edge, running = guarded(an_input(button.name))
    async with running:
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        await requests.until(lambda: is_heard(edge))
        assert (await requested(edge, "rex", "move_forward", linear_x=0.5)).ok
        button.beats = False
        await requests.until(lambda: stopped(edge, "rex") and stopped(edge, "max"))
        await requests.until(lambda: {"halt", "stop"} <= set(place.words("rex")))
        await requests.until(lambda: "stop input button: no heartbeat for 1 s" in edge.state().cause)
        refused = await requested(edge, "rex", "move_forward")
        assert "emergency stop is set (stop input button: no heartbeat" in refused.reason


async def test_a_stop_cannot_be_released_without_the_heartbeat_and_is_not_released_by_it(
    guarded, button, requests
):
    _, edge, running = guarded(an_input(button.name))
    async with running:
        await requests.until(lambda: is_heard(edge))
        button.beats = False
        await requests.until(lambda: stopped(edge, "rex"))
        released = await requested(edge, "rex", "release_emergency_stop")
        assert not released.ok
        assert released.reason == "stop input button: no heartbeat for 1 s"
        button.beats = True
        await requests.until(lambda: is_heard(edge))
        assert stopped(edge, "rex")
        assert (await requested(edge, "rex", "release_emergency_stop")).ok
        assert not stopped(edge, "rex")


async def test_a_device_that_cannot_be_opened_stops_and_is_reported_until_it_is_there(
    guarded, tmp_path, requests
):
    device = tmp_path / "none"
    _, edge, running = guarded(an_input(str(device)))
    async with running:
        await requests.until(lambda: stopped(edge, "rex"))
        cause = f"stop input button: {device}: No such file or directory"
        await requests.until(lambda: cause in edge.state().cause)
        assert not (await requested(edge, "rex", "release_emergency_stop")).ok
        button = Button()
        device.symlink_to(button.name)
        await requests.until(lambda: is_heard(edge))
        assert stopped(edge, "rex")
        assert (await requested(edge, "rex", "release_emergency_stop")).ok
    button.unplug()


async def test_a_device_that_is_pulled_out_stops_at_once(guarded, button, requests):
    _, edge, running = guarded(an_input(button.name, timeout=5.0))
    async with running:
        await requests.until(lambda: is_heard(edge))
        pulled = time.monotonic()
        button.unplug()
        await requests.until(lambda: stopped(edge, "rex"))
        assert time.monotonic() - pulled < 4.0


async def test_an_input_stops_only_the_robots_that_it_names(guarded, button, requests):
    _, edge, running = guarded(an_input(button.name, robots=["rex"]))
    async with running:
        await requests.until(lambda: is_heard(edge))
        button.beats = False
        await requests.until(lambda: stopped(edge, "rex"))
        assert not stopped(edge, "max")
        assert (await requested(edge, "max", "move_forward")).ok


async def test_bytes_that_are_not_the_heartbeat_let_nothing_move(guarded, button, requests):
    button.word = b"\x00noise"
    _, edge, running = guarded(an_input(button.name, heartbeat="ALIVE"))
    async with running:
        await requests.until(lambda: stopped(edge, "rex"))
        button.word = b"IVEAL"  # cut anywhere by the line
        await requests.until(lambda: is_heard(edge))


async def test_the_heartbeat_is_missed_while_the_event_loop_is_stuck(guarded, button, requests):
    place, edge, running = guarded(an_input(button.name))
    async with running:
        await requests.until(lambda: is_heard(edge))
        assert (await requested(edge, "rex", "move_forward", linear_x=0.5)).ok
        before = place.words("rex").count("halt")
        button.beats = False
        block_until(lambda: stopped(edge, "rex") and place.words("rex").count("halt") > before)


async def test_nothing_moves_before_the_first_heartbeat_and_no_stop_is_set_by_waiting_for_it(
    guarded, button, requests
):
    button.beats = False
    _, edge, running = guarded(an_input(button.name, timeout=5.0))
    async with running:
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        assert (
            "stop input button has sent no heartbeat yet"
            in (await requested(edge, "rex", "move_forward")).reason
        )
        button.beats = True
        await requests.until(lambda: is_heard(edge))
        assert not stopped(edge, "rex")
        assert (await requested(edge, "rex", "move_forward")).ok


async def requested_on_the_bus(place, edge, name, command):
    """Ask a robot on its own key, where its worker answers; returns the receipt."""
    bus_session = await asyncio.to_thread(place.bus_session)
    key = f"fleet/{edge.state().edge}/robots/{name}/command"
    message = json.dumps({"command": command}).encode()
    (answer,) = await asyncio.to_thread(lambda: list(bus_session.request(key, message, timeout=60)))
    await asyncio.to_thread(bus_session.close)
    return json.loads(answer[1])


async def test_a_robot_in_a_worker_is_held_from_its_start_until_the_heartbeat_is_heard(
    guarded, button, requests
):
    button.beats = False
    place, edge, running = guarded(an_input(button.name, timeout=5.0), max_worker="other")
    async with running:
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        assert (await requested_on_the_bus(place, edge, "max", "move_forward"))["status"] == "rejected"
        refused = await requested_on_the_bus(place, edge, "max", RELEASE)
        assert refused["status"] == "rejected"
        assert "stop input" in refused["reason"]  # not heard yet, or by now silent for too long
        assert "move" not in " ".join(place.words("max"))
        button.beats = True
        async with asyncio.timeout(60):
            for command in (RELEASE, "move_forward"):
                while (await requested_on_the_bus(place, edge, "max", command))["status"] != "accepted":
                    pass


async def test_a_robot_in_a_worker_is_stopped_too_and_is_not_released_meanwhile(guarded, button, requests):
    place, edge, running = guarded(an_input(button.name), max_worker="other")
    async with running:
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        await requests.until(lambda: is_heard(edge))
        button.beats = False
        await requests.until(lambda: "stop" in place.words("max"))
        await requests.until(lambda: stopped(edge, "max"))
        async with asyncio.timeout(60):  # the edge's word that it is held may come a tenth of a second later
            while (reply := await requested_on_the_bus(place, edge, "max", RELEASE))["status"] == "accepted":
                pass
        assert "no heartbeat for 1 s" in reply["reason"]
        await requests.until(lambda: stopped(edge, "max"))


def test_a_lost_heartbeat_holds_and_stops_before_it_is_logged(blocked_log):
    done = []
    one = StopInput(
        CONFIG,
        stop=lambda why: done.append(("stop", why)),
        hold=lambda: done.append(("hold", one.trouble)),
        renew=lambda _: None,
        clock=ManualClock(),
    )
    why = "stop input button: no heartbeat for 0.5 s"
    with blocked_log("fleet.host.process.stop_inputs"):
        thread = threading.Thread(target=one.watched().expired, daemon=True)
        thread.start()
        wait_until("it is stopped while the log hangs", lambda: len(done) == 2)
        assert thread.is_alive()
    thread.join(60)
    assert done == [("hold", why), ("stop", why)]


def test_an_input_whose_stop_fails_goes_on_to_listen_and_stops_again():
    renewed = []

    def fails(_why):
        raise RuntimeError("dictionary changed size during iteration")

    one = StopInput(CONFIG, stop=fails, hold=lambda: None, renew=renewed.append, clock=ManualClock())
    one.start()
    wait_until("the stop is set again", lambda: renewed)
    one.end()
    assert "/dev/null" in renewed[0]


CONFIG = StopInputConfig(name="button", kind="serial", device="/dev/null", robots=("ground",))
GROUPS = {"ground": ["max"]}


def test_a_worker_holds_its_robots_before_the_edge_s_word_and_while_the_edge_is_silent():
    clock, latches = ManualClock(), {"max": EmergencyStopLatch(), "kestrel": EmergencyStopLatch()}
    named = robots_of([CONFIG], GROUPS, latches)
    ended = []
    held = HeldByEdge(
        {robot: latches[robot] for robot in named}, ended=lambda *change: ended.append(change), clock=clock
    )
    assert "has not confirmed" in latches["max"].refusal()
    assert latches["kestrel"].refusal() is None, "no input names it"
    held.apply(b'{"max": "stop input button has sent no heartbeat yet"}')
    assert latches["max"].refusal() == "stop input button has sent no heartbeat yet"
    held.apply(b"{}")
    assert latches["max"].refusal() is None
    held.apply(b"[1]")
    clock.advance(SILENT_AFTER)
    held.check()
    assert latches["max"].refusal() is None
    clock.advance(0.1)
    held.check()
    assert "is silent" in latches["max"].refusal()
    held.check()
    assert ended == [("max", latches["max"].held)], "once for each time"
    held.apply(b"{}")
    assert latches["max"].refusal() is None
    held.apply(b'{"max": "stop input button: no heartbeat for 0.5 s"}')
    assert ended[1:] == [("max", "stop input button: no heartbeat for 0.5 s")]


def test_a_worker_that_hears_nothing_at_all_holds_its_robots_for_ever():
    clock, latches = ManualClock(), {"max": EmergencyStopLatch()}
    everything = StopInputConfig(name="all", kind="serial", device="/dev/null")
    assert robots_of([everything], {}, latches) == ("max",)
    held = HeldByEdge(latches, ended=lambda *_: None, clock=clock)
    for _ in range(100):
        clock.advance(1.0)
        held.check()
        assert latches["max"].refusal()


def test_every_robot_is_held_though_another_joins_meanwhile():
    latches = {"max": EmergencyStopLatch(), "eve": EmergencyStopLatch()}
    joins = lambda *_: latches.setdefault("new", EmergencyStopLatch())  # noqa: E731
    clock = ManualClock()
    held = HeldByEdge(latches, ended=joins, clock=clock)
    held.apply(b"{}")
    held.apply(b'{"max": "unplugged", "eve": "unplugged"}')
    assert latches["eve"].refusal() == "unplugged"
    latches.pop("new")
    held.apply(b"{}")
    clock.advance(SILENT_AFTER + 0.1)
    held.check()
    assert latches["eve"].refusal()


@pytest.mark.parametrize("how", ["driving", "goal"])
async def test_what_moves_a_robot_of_a_worker_is_ended_when_the_edge_is_silent(bench, requests, how):
    controller, said = bench.controller, b"{}"
    held = HeldByEdge({"rex": controller.latch}, ended=lambda _, why: controller.end(why), clock=bench.clock)
    held.apply(said)
    (answer,) = bench.request(requests.goal() if how == "goal" else requests.setpoint(lease=5.0))
    assert answer.ok
    await requests.settle()
    bench.clock.advance(SILENT_AFTER + 0.1)
    held.check()
    assert not controller.in_motion
    await requests.settle()
    assert "stop" in bench.adapter.calls
    assert "is silent" in bench.request(requests.setpoint())[0].reason


async def test_a_landing_goes_on_when_the_edge_is_silent(bench, requests):
    controller = bench.controller
    held = HeldByEdge({"rex": controller.latch}, ended=lambda _, why: controller.end(why), clock=bench.clock)
    held.apply(b"{}")
    bench.request(requests.command("land"))
    await requests.settle()
    bench.clock.advance(SILENT_AFTER + 0.1)
    held.check()
    await requests.settle()
    assert bench.adapter.calls == ["land"]


def test_an_input_that_is_heard_does_not_free_a_robot_that_another_holds_at_the_same_time():
    latch = EmergencyStopLatch()
    configs = [StopInputConfig(**an_input("/dev/null", name=name)) for name in ("left", "right")]
    nothing = {"stop": lambda *_: None, "renew": lambda *_: None}
    inputs = StopInputs(configs, {}, {"rex": latch}, (), clock=ManualClock(), **nothing)
    left, right = (one for one, _ in inputs._inputs)
    right.trouble = ""
    judged, go, why = threading.Event(), threading.Event(), inputs._hold_reason

    def slowly(robot):
        found = why(robot)
        if threading.current_thread() is hearing:
            judged.set()
            assert go.wait(60)
        return found

    inputs._hold_reason = slowly
    hearing = threading.Thread(target=left._heard)
    losing = threading.Thread(target=right._lost, args=("unplugged",))
    hearing.start()
    assert judged.wait(60)
    losing.start()
    wait_until("the loss is seen", lambda: right.trouble)
    go.set()
    hearing.join()
    losing.join()
    assert latch.held == "stop input right: unplugged"
