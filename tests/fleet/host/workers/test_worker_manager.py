"""Worker processes that are killed, frozen and hung, and the edge that watches them."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import psutil
import pytest

from fleet.bus import keys
from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.host.edge.edge import Edge
from fleet.host.process.component_settings import worker_of
from fleet.host.requests.stop_cause import STOP_KEY_CAUSE
from fleet.host.workers.worker_manager import WorkerManager, names_of
from fleet.model.command import Reply, Transport
from fleet.supervisor.client import SupervisorClient
from fleet.supervisor.protocol import StopRequest
from tests.tools.waiting import wait_until

MOVE = {"command": "move_forward", "data": {"linear_x": 1.0}}
GOTO = {"command": "goto", "position": [1.0, 2.0, 0.0], "action_id": "a1"}


def state_of(edge, name):
    return next(state for state in edge.states() if state.name == name)


def say(bus_session, place, robot, message, kind="command"):
    """Ask a robot on its own bus key; returns its replies."""
    key, payload = keys.command(place.id, robot), json.dumps(message).encode()
    answers = bus_session.request(key, payload, timeout=60, parameters={"kind": kind})
    return [msgspec.json.decode(answer, type=Reply) for _, answer in answers]


def say_and_leave(bus_session, place, robot, name):
    """Ask for a command that nobody will answer."""
    payload = json.dumps({"command": name}).encode()
    nobody = lambda *_: None  # noqa: E731
    bus_session.request_later(
        keys.command(place.id, robot), payload, timeout=5, on_answer=nobody, on_end=lambda: None
    )


class Passing(SupervisorClient):
    """A supervisor's client through which the test passes stops on."""

    def begin(self, edge, worker="", *, stop, end):
        self.stop = stop


class Field:
    """A running edge: arm in a worker of its own, rex in the edge's process."""

    def __init__(self, place, edge, bus_session, supervised):
        self.place, self.edge, self.bus_session, self.supervised = place, edge, bus_session, supervised

    async def request(self, robot, message, kind="command"):
        return await asyncio.to_thread(say, self.bus_session, self.place, robot, message, kind)

    @property
    def worker(self):
        return self.place.processes("arm")[-1]


@pytest.fixture
async def field(yard, run_edge, requests):
    place, passing = yard(arm={}, rex={"worker": "main"}), Passing()
    edge = Edge(load(place.file), directory=place.runtime, clock=SystemClock(), supervised=passing)
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        yield Field(place, edge, bus_session, passing)
        await asyncio.to_thread(bus_session.close)


def test_a_drop_in_plugin_has_a_worker_unless_its_robot_says_main(yard):
    place = yard(arm={}, rex={"worker": "main"}, leg={"worker": "legs"})
    workers = {robot.name: worker_of(robot, plugin) for robot, plugin in load(place.file).robots}
    assert workers == {"arm": "arm", "rex": "", "leg": "legs"}


def test_each_worker_is_started_once():
    assert names_of(["legs", "", "arm", "legs"]) == ["arm", "legs"]


async def test_a_robot_in_a_worker_is_commanded_through_the_edge_and_on_its_own_key_and_stopped_by_all(
    field, requests
):
    assert field.worker != os.getpid()
    assert field.place.processes("rex") == [os.getpid()]
    await is_left_to_the_edge_that_the_cloud_shows(field, requests)
    (reply,) = await field.request("arm", MOVE)
    assert reply.ok
    replies = []
    payload = json.dumps(MOVE | {"source_type": "tele"}).encode()
    field.edge.remote["arm"].read("command", payload, transport=Transport.CLOUD)(replies.append)
    await requests.until(lambda: replies)
    assert replies[0].ok
    await requests.until(lambda: field.place.words("arm")[-1] == "drive:0")
    assert field.place.words("arm")[2:] == ["drive:1", "drive:1", "halt", "drive:0"]
    await a_stop_of_any_origin_reaches_it_with_its_words(field, requests)


async def is_left_to_the_edge_that_the_cloud_shows(field, requests):
    """Claim a robot that nobody uses yet for another edge, and give it back: it runs again."""
    twin = field.edge.remote["arm"].twin
    field.edge.cloud_claims.handle_claim(twin, "yard-0")
    await requests.until(lambda: "edge yard-0 has its twin" in state_of(field.edge, "arm").cause)
    assert state_of(field.edge, "rex").health == "ok"
    field.edge.cloud_claims.handle_claim(twin, "")
    await requests.until(lambda: field.place.words("arm") == ["run", "run"])
    await requests.until(lambda: state_of(field.edge, "arm").health == "ok")


async def a_stop_of_any_origin_reaches_it_with_its_words(field, requests):
    """Stop it by the supervisor, by a stop input and on the bus."""
    stop = StopRequest(names=("arm",), by="anna", why="smoke", request="r1")
    asked = "asked by anna (claimed, on this computer): smoke"
    await stops_arm(field, requests, lambda: field.supervised.stop(stop), asked)
    assert not state_of(field.edge, "rex").emergency_stop
    no_heartbeat = "stop input button: no heartbeat for 1 s"
    await stops_arm(field, requests, lambda: field.edge._stop_robots((), no_heartbeat), no_heartbeat)
    key = keys.stop(field.place.id)
    await stops_arm(
        field, requests, lambda: field.bus_session.put(key, b"", urgent=True), STOP_KEY_CAUSE.sentence
    )


async def stops_arm(field, requests, stop, cause):
    """Stop it with a cause; it is released first if it is stopped already.

    Each stop arrives by two sessions: the second copy may set it again after the release, with the old cause.
    """
    while state_of(field.edge, "arm").stop_cause != cause:
        await released(field, requests)
        words = field.place.words("arm").count("stop")
        stop()
        await requests.until(lambda words=words: field.place.words("arm").count("stop") > words)
        await requests.until(lambda: state_of(field.edge, "arm").stop_cause)


async def released(field, requests):
    """Release all robots until arm is shown without a stop."""
    while state_of(field.edge, "arm").emergency_stop:
        for robot in ("arm", "rex"):
            if state_of(field.edge, robot).emergency_stop:
                (*_, reply) = await field.request(robot, {"command": "release_emergency_stop"})
                assert reply.ok, reply.reason
        since = time.time()
        await requests.until(lambda since=since: state_of(field.edge, "arm").stamp > since)


async def test_a_worker_keeps_a_robot_that_somebody_moves_whatever_the_cloud_shows_until_the_edge_ends(
    yard, run_edge, requests
):
    place = yard(arm={})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: state_of(edge, "arm").health == "ok")
        bus_session = await asyncio.to_thread(place.bus_session)
        (reply,) = await asyncio.to_thread(say, bus_session, place, "arm", GOTO, "navigate")
        assert reply.ok
        await asyncio.to_thread(bus_session.close)
        twin = edge.remote["arm"].twin
        # As when the worker's word that the robot is used has not come yet.
        edge.cloud_claims._holders[twin] = "yard-0"
        edge.cloud_claims.notify_workers()
        await requests.until(lambda: state_of(edge, "arm").in_use)
        edge.cloud_claims.handle_claim(twin, "yard-0")
        assert "yard-0" in edge.state().cause
        assert place.words("arm") == ["run", "navigate"]
    assert place.words("arm")[-2:] == ["halt", "stop"]
    assert not psutil.pid_exists(place.processes("arm")[0])


FAULTS = {
    # what befalls the worker: how, and the seconds within which the edge knows
    "killed": (lambda field: os.kill(field.worker, signal.SIGKILL), 1.0),
    "frozen": (lambda field: os.kill(field.worker, signal.SIGSTOP), 2.5),
    "hung": (lambda field: say_and_leave(field.bus_session, field.place, "arm", "hang"), 3.5),
}


async def test_a_worker_that_fails_is_noticed_and_started_again_and_nothing_moves_by_itself(field, requests):
    for number, fault in enumerate(FAULTS):
        await fails(field, requests, fault, GOTO | {"action_id": f"a{number}"})


async def fails(field, requests, fault, goal):
    """Let a fault befall the worker on the way to a goal; at the end it runs again."""
    befall, within = FAULTS[fault]
    (reply,) = await field.request("arm", goal, "navigate")
    assert reply.ok
    # it is on its way, not merely accepted
    await requests.until(lambda: field.place.words("arm")[-1] == "navigate")
    first, starts = field.worker, len(field.place.processes("arm"))
    began = time.monotonic()
    befall(field)
    await requests.until(lambda: state_of(field.edge, "arm").health == "offline")
    # A busy machine takes seconds more.
    assert time.monotonic() - began < 5 * within
    assert "worker arm" in state_of(field.edge, "arm").cause
    (reply,) = await field.request("rex", MOVE)
    assert reply.ok
    await requests.until(lambda: state_of(field.edge, "arm").health == "ok")
    assert len(field.place.processes("arm")) == starts + 1
    assert not psutil.pid_exists(first)
    words = lambda: [word for pid, _, word in field.place.calls("arm") if pid == field.worker]  # noqa: E731
    await requests.until(lambda: words() == ["run", "stop"])  # it may still have been on its way
    assert len(field.place.processes("rex")) == 1
    assert not state_of(field.edge, "arm").emergency_stop
    if fault == "hung":  # its bus threads still heard that it is to stop
        assert "halt" in [word for pid, _, word in field.place.calls("arm") if pid == first]


def test_a_worker_ends_with_an_edge_that_was_killed_and_holds_its_robots(yard):
    place = yard(arm={})
    command = [sys.executable, "-m", "fleet", "run", str(place.file)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as edge:
        try:
            wait_until("the robot runs", lambda: place.processes("arm"))
            bus_session = place.bus_session()
            wait_until(
                "it is moved",
                lambda: [one for one in say(bus_session, place, "arm", GOTO, "navigate") if one.ok],
            )
        finally:
            edge.kill()
        bus_session.close()
    wait_until("its robot is held", lambda: place.words("arm")[-1] == "stop")
    wait_until("the worker has ended", lambda: not psutil.pid_exists(place.processes("arm")[0]))


class FailingWorker:
    """A worker that cannot even be started, and what is said of it."""

    def __init__(self, monkeypatch, on_problem=None, halt=lambda name: None):
        self.said, self.tries = [], 0
        bus_session = type(
            "BusSession", (), {"subscribe": lambda *_: None, "watch_tokens": lambda *_: None}
        )()

        async def refuse(*_, **__):
            self.tries += 1
            raise OSError(24, "Too many open files")

        monkeypatch.setattr(asyncio, "create_subprocess_exec", refuse)
        self.worker = WorkerManager(
            "arm",
            edge="yard",
            task=b"{}",
            directory="/nowhere",
            control=bus_session,
            clock=SystemClock(),
            on_problem=on_problem or (lambda name, cause: self.said.append(cause)),
            halt=halt,
        )


async def test_a_worker_that_cannot_be_started_is_reported_and_tried_again(monkeypatch, requests):
    worker = FailingWorker(monkeypatch)
    task = asyncio.create_task(worker.worker.run())
    await requests.until(lambda: worker.tries > 1)
    task.cancel()
    await asyncio.wait({task})
    assert worker.said[0] == "worker arm: cannot be started: Too many open files"


async def test_a_hanging_worker_is_killed_though_its_halt_and_the_report_fail(monkeypatch, requests):
    processes, start = [], asyncio.create_subprocess_exec

    async def started(*_, **options):
        processes.append(await start("sleep", "600", **options))
        return processes[-1]

    def fail(*_):
        raise ZeroDivisionError("oops")

    worker = FailingWorker(monkeypatch, on_problem=fail, halt=fail).worker
    monkeypatch.setattr(asyncio, "create_subprocess_exec", started)
    monkeypatch.setattr("fleet.host.workers.worker_manager.START_WITHIN", 0.0)
    task = asyncio.create_task(worker.run())
    await requests.until(lambda: len(processes) > 1)
    assert processes[0].returncode == -signal.SIGKILL
    task.cancel()
    await asyncio.wait({task})
    assert task.cancelled()


async def test_a_worker_has_neither_the_clouds_token_nor_the_edges_environment(
    yard, run_edge, requests, monkeypatch, broker
):
    monkeypatch.setenv("CYBERWAVE_API_KEY", "canary-environment")
    monkeypatch.setenv("SOME_SECRET", "canary-other")
    place = yard(arm={}, leg={"worker": "main", "journal": "/dev/null"})
    cloud = {"host": "127.0.0.1", "port": broker.port, "tls": False, "token": "canary-token"}
    place.change(cloud=cloud)
    edge = place.edge()
    (manager,) = edge._workers.managers.values()
    task = manager._task
    assert b"canary" not in task
    assert [robot["name"] for robot in msgspec.json.decode(task)["robots"]] == ["arm"]
    async with run_edge(edge):
        await requests.until(lambda: state_of(edge, "arm").health == "ok")
        (worker,) = place.processes("arm")
        process = psutil.Process(worker)
        assert "canary" not in json.dumps(process.environ())
        assert str(place.file) not in " ".join(process.cmdline())
        assert "canary" not in memory_of(worker)


def memory_of(process):
    """Return what in the memory of a process begins like our secrets."""
    found = []
    place = Path(f"/proc/{process}")
    with (place / "maps").open() as maps, (place / "mem").open("rb") as memory:
        for line in maps:
            where, rights = line.split()[:2]
            if rights.startswith("rw"):
                begin, end = (int(part, 16) for part in where.split("-"))
                memory.seek(begin)
                try:
                    found.append("canary" if b"canary-" in memory.read(end - begin) else "")
                except OSError:  # of the kernel's own
                    continue
    return "".join(found)


async def test_the_edge_imports_no_drop_in_file_but_of_a_robot_that_says_main(yard):
    place = yard(arm={}, rex={"worker": "main"})
    note = place.file.with_name("imports")
    toy = place.file.parent / "plugins" / "toy.py"
    toy.write_text(
        toy.read_text() + f"\nwith open({str(note)!r}, 'a') as note:\n    note.write(f'{{os.getpid()}} ')\n"
    )
    loaded = load(place.file)
    assert str(os.getpid()) not in note.read_text().split()
    edge = Edge(loaded, directory=place.runtime, clock=SystemClock())
    assert note.read_text().split().count(str(os.getpid())) == 1
    assert {state.name: state.drop_in for state in edge.states()} == {"arm": "", "rex": str(toy)}
    edge.bus.close()
    await edge.process.close()
