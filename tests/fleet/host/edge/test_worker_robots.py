"""The side of the edge of robots in workers, and of the worker processes."""

import asyncio
import threading
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.edge import worker_robots
from fleet.host.edge.worker_robots import RemoteRobots, Workers
from fleet.host.runtime.threads import NAME
from fleet.model.event import EventKind, Severity
from fleet.model.state import RobotState
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE, wait_until

INSTALLED, DROP_IN = Plugin("toy", "a package"), Plugin("toy", "/plugins/toy.py")


class Bus:
    """The control session of an edge, and what its robots need of it."""

    def __init__(self):
        self.subscriptions, self.ended, self.puts = [], [], []

    def subscribe_many(self, pattern, calls):
        self.subscriptions.append((pattern, calls))

    def declare_queryable(self, key, _call):
        return lambda: self.ended.append(key)

    def watch_tokens(self, key, _call):
        return lambda: self.ended.append(key)

    def put(self, key, payload, *, urgent):
        self.puts.append((key, payload, urgent, threading.current_thread().name))

    def say(self, name, robot, **fields):
        """Publish the state of a robot as its worker does."""
        state = RobotState(name, str(robot.config.twin), "toy", "yard", 1000.0, **fields)
        for pattern, calls in self.subscriptions:
            assert pattern == keys.state("yard", "*")
            if call := calls.get(keys.state("yard", name)):
                call(msgspec.json.encode(state))


class Process:
    """The edge's own process."""

    edge = "yard"

    def __init__(self):
        control = Bus()
        self.bus, self.clock = SimpleNamespace(control=control), ManualClock()
        self.sent, self.events = [], []
        self.outbox = SimpleNamespace(sender=lambda twin: lambda report: self.sent.append((twin, report)))
        self.history = SimpleNamespace(add=lambda robot, event: self.events.append((robot, event)))
        self.watchdog = SimpleNamespace(arrival=self.clock.monotonic)
        self.loop = SimpleNamespace(call_soon_threadsafe=lambda call: call())


def loaded_of(*robots, remote=()):
    """Return a file of robots, each with its plugin; ``remote``: workers that are started by hand."""
    return SimpleNamespace(robots=robots, config=SimpleNamespace(remote_workers=remote))


def robot(name, plugin=INSTALLED, worker=None):
    number = sum(name.encode())
    return AdapterConfig(name=name, twin=f"6f0c9a1e-0000-4000-8000-{number:012}", worker=worker), plugin


@pytest.fixture
def process():
    return Process()


@pytest.fixture
def bus(process):
    return process.bus.control


def test_only_the_robots_of_workers_are_represented(process):
    loaded = loaded_of(
        robot("arm", worker="limbs"), robot("rex"), robot("tom", DROP_IN), robot("max", DROP_IN, "main")
    )
    remote = RemoteRobots(loaded, process)
    assert {name: one.worker for name, one in remote.by_name.items()} == {"arm": "limbs", "tom": "tom"}


def test_all_robots_share_one_subscription_and_each_has_its_own_states(process, bus):
    remote = RemoteRobots(loaded_of(robot("arm", worker="limbs"), robot("leg", worker="limbs")), process)
    bus.say("leg", remote.by_name["leg"], health="ok", mode="GUIDED")
    states = {name: one.state() for name, one in remote.by_name.items()}
    assert (states["arm"].health, states["leg"].health, states["leg"].mode) == ("offline", "ok", "GUIDED")
    assert len(bus.subscriptions) == 1


def test_an_edge_without_workers_subscribes_to_nothing_until_there_is_one(process, bus):
    remote = RemoteRobots(loaded_of(robot("rex")), process)
    assert bus.subscriptions == []
    added = remote.add(*robot("arm", worker="limbs"))
    bus.say("arm", added, health="ok")
    assert (remote.by_name["arm"], added.state().health) == (added, "ok")


def test_the_reports_of_a_robot_go_out_under_its_twin(process):
    remote = RemoteRobots(loaded_of(robot("arm", worker="limbs")), process)
    remote.by_name["arm"].publish("report")
    assert process.sent == [(remote.by_name["arm"].twin, "report")]


def test_a_robot_that_is_removed_is_heard_and_represented_no_more(process, bus):
    remote = RemoteRobots(loaded_of(robot("arm", worker="limbs"), robot("leg", worker="limbs")), process)
    arm = remote.by_name["arm"]
    remote.remove(arm)
    bus.say("arm", arm, health="ok")
    assert (list(remote.by_name), arm.state().health) == (["leg"], "offline")
    assert bus.ended == [keys.state("yard", "arm"), keys.robot("yard", "arm")]
    remote.remove(arm)  # a second time changes nothing
    assert list(remote.by_name) == ["leg"]


class Manager:
    """The manager of a worker that runs until it is cancelled, and then for one more round."""

    def __init__(self, name, **given):
        self.name, self.given, self.log = name, given, []

    async def run(self):
        self.log.append("runs")
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(0)
            self.log.append("ended")

    def close(self):
        self.log.append("closed")


@pytest.fixture
def workers(process, monkeypatch, tmp_path):
    """Return the maker of the workers of some robots."""
    monkeypatch.setattr(worker_robots, "WorkerManager", Manager)
    monkeypatch.setattr(worker_robots, "task_of", lambda _loaded, name: {"worker": name})

    def make(*robots, remote=()):
        loaded = loaded_of(*robots, remote=remote)
        found = RemoteRobots(loaded, process).by_name
        return Workers(loaded, tmp_path, process, found), found

    return make


async def test_each_worker_is_managed_once_but_one_that_is_started_by_hand(workers):
    made, _ = workers(
        *(robot("arm", worker="limbs"), robot("leg", worker="limbs"), robot("tom", DROP_IN)),
        robot("max", worker="away"),
        remote=("away",),
    )
    assert {name: manager.given["task"] for name, manager in made.managers.items()} == {
        "limbs": b'{"worker":"limbs"}',
        "tom": b'{"worker":"tom"}',
    }


async def test_workers_run_from_their_start_until_all_have_ended(workers):
    made, _ = workers(robot("arm", worker="limbs"), robot("tom", DROP_IN))
    made.start()
    await asyncio.sleep(0)
    logs = [manager.log for manager in made.managers.values()]
    assert logs == [["runs"], ["runs"]]
    made.cancel()
    await made.ended()
    assert logs == [["runs", "ended"], ["runs", "ended"]]


async def test_one_worker_comes_and_goes_while_the_others_run(workers):
    made, _ = workers(robot("tom", DROP_IN))
    made.start()
    added = made.add("limbs", loaded_of(robot("arm", worker="limbs")))
    await asyncio.sleep(0)
    await made.end("limbs")
    assert (added.log, list(made.managers)) == (["runs", "ended", "closed"], ["tom"])
    assert made.managers["tom"].log == ["runs"]
    made.cancel()
    await made.ended()


async def test_a_workers_problem_is_that_of_its_own_robots_and_is_recorded_for_each(workers, process):
    made, remote = workers(robot("arm", worker="limbs"), robot("leg", worker="limbs"), robot("tom", DROP_IN))
    made.managers["limbs"].given["on_problem"]("limbs", "worker limbs: killed by SIGKILL")
    causes = {name: one.state().cause for name, one in remote.items()}
    assert causes["arm"] == causes["leg"] == "worker limbs: killed by SIGKILL"
    assert causes["tom"] == "its worker is starting"
    assert [name for name, _ in process.events] == ["arm", "leg"]
    _, lost = process.events[0]
    assert (lost.kind, lost.severity, lost.text) == (EventKind.LOST, Severity.ERROR, causes["arm"])


async def test_a_worker_that_runs_again_is_no_event(workers, process):
    made, remote = workers(robot("arm", worker="limbs"))
    made.managers["limbs"].given["on_problem"]("limbs", "")
    assert (process.events, remote["arm"].state().cause) == ([], "its worker is silent")


async def test_the_halt_of_a_hanging_worker_does_not_hold_up_the_loop_on_a_full_link(workers, bus):
    freed, put, done = threading.Event(), bus.put, []

    def block(*arguments, **how):
        freed.wait(DEADLINE)
        put(*arguments, **how)
        done.append(1)

    bus.put = block
    made, _ = workers(robot("arm", worker="limbs"))
    made.managers["limbs"].given["halt"]("limbs")  # returns with the link full
    freed.set()
    wait_until("it is on its way", lambda: done)
    assert bus.puts == [(keys.halt("yard", "limbs"), b"", True, NAME)]


async def test_a_halt_over_a_closed_bus_is_reported(workers, bus, caplog):
    def fail(*_, **__):
        raise RuntimeError("the session is closed")

    bus.put = fail
    made, _ = workers(robot("arm", worker="limbs"))
    made.managers["limbs"].given["halt"]("limbs")
    wait_until("it is told", lambda: "its robots could not be halted over the bus" in caplog.text)
