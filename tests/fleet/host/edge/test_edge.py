"""An edge from a fleet.yaml to its orderly end, with robots that are told nothing but what was asked."""

import asyncio
import json
import logging
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import psutil
import pytest

from fleet.bus import keys
from fleet.cloud.values import CloudState
from fleet.errors import BusError
from fleet.model.command import Reply, ReplyStatus
from fleet.model.health import Health, Level
from fleet.model.state import EdgeState, RobotState
from fleet.rollout.edge_here import LocalEdge
from fleet.rollout.faults import PartFault
from tests.tools.waiting import wait_until

POOLS = ("asyncio", "uvloop")  # whose threads stay for the next one
HERE = {"worker": "main"}


def request(bus_session, key, message=b"", kind=None, **parameters):
    """Ask on the bus; returns the decoded answers."""
    payload = message if isinstance(message, bytes) else json.dumps(message).encode()
    given = parameters | ({"kind": kind} if kind else {})
    return [answer for _, answer in bus_session.request(key, payload, timeout=60, parameters=given)]


def command(bus_session, yard, robot, message, kind="command", **parameters):
    """Ask a robot; returns its replies."""
    answers = request(bus_session, keys.command(yard.id, robot), message, kind, **parameters)
    return [msgspec.json.decode(answer, type=Reply) for answer in answers]


MOVE = {"command": "move_forward", "data": {"linear_x": 1.0}}
GOTO = {"command": "goto", "position": [1.0, 2.0, 0.0], "action_id": "a1"}


@pytest.fixture
async def served(yard, run_edge, requests):
    """Run an edge with two robots, a lane to ask on, and its yard."""
    place = yard(rex=HERE, max=HERE)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        yield place, edge, bus_session
        await asyncio.to_thread(bus_session.close)


async def test_an_edge_tells_every_problem_of_its_own_and_the_agent_of_roll_outs_reads_it(served):
    place, edge, _ = served
    here = LocalEdge(place.id, place.file)
    assert (await asyncio.to_thread(here.running)).faults == ()
    edge.beside = lambda: "the console does not run"
    edge.missions.store.problem = "runs are not recorded"
    faults = [PartFault("the edge", "degraded", each) for each in edge.state().problems]
    assert {each.cause for each in faults} >= {"the console does not run", "runs are not recorded"}
    assert (await asyncio.to_thread(here.running)).faults == tuple(faults)


async def test_a_robot_is_commanded_on_its_bus_key_and_the_lease_ends_it(served, requests):
    place, _, bus_session = served
    (reply,) = await asyncio.to_thread(command, bus_session, place, "rex", MOVE)
    assert reply.ok
    await requests.until(lambda: place.words("rex")[-1] == "drive:0")
    assert place.words("rex") == ["run", "drive:1", "halt", "drive:0"]
    assert place.words("max") == ["run"]


async def test_a_robots_state_and_the_edges_are_on_the_bus(served):
    place, _, bus_session = served
    (state,) = await asyncio.to_thread(request, bus_session, keys.state(place.id, "rex"))
    (health,) = await asyncio.to_thread(request, bus_session, keys.health(place.id))
    assert msgspec.json.decode(state, type=RobotState).health == "ok"
    assert msgspec.json.decode(health, type=EdgeState).robots == {"ok": 2}


async def test_the_edge_and_its_robots_are_alive_on_the_bus(served, requests):
    place, _, bus_session = served
    alive = {}
    bus_session.watch_tokens(f"fleet/{place.id}/**", alive.__setitem__)
    expected = {keys.edge(place.id), keys.robot(place.id, "rex"), keys.robot(place.id, "max")}
    await requests.until(lambda: expected <= {key for key, there in alive.items() if there})


async def test_an_unknown_kind_of_message_is_refused(served):
    place, _, bus_session = served
    (reply,) = await asyncio.to_thread(command, bus_session, place, "rex", MOVE, kind="poem")
    assert (reply.status, "poem" in reply.reason) == (ReplyStatus.REJECTED, True)


async def test_an_emergency_stop_reaches_every_robot_though_the_halt_of_one_raises(served, requests):
    place, edge, bus_session = served

    def refuse():
        raise ZeroDivisionError("oops")

    edge.process.robots["rex"].controller.attached.adapter.halt = refuse
    bus_session.put(keys.stop(place.id), b"", urgent=True)
    await requests.until(lambda: "stop" in place.words("max") and "stop" in place.words("rex"))
    assert all(state.emergency_stop for state in edge.states())


async def test_an_emergency_stop_is_written_while_the_loop_is_stuck(served, requests):
    place, edge, bus_session = served
    halted = threading.Event()
    edge.process.robots["rex"].controller.attached.adapter.halt = halted.set
    threading.Timer(0.1, bus_session.put, (keys.stop(place.id), b""), {"urgent": True}).start()
    assert halted.wait(20)  # this blocks the loop
    await requests.until(lambda: edge.process.robots["rex"].controller.latched)


async def test_a_robot_that_fails_for_ever_does_not_disturb_its_neighbour(served, requests):
    place, edge, bus_session = served
    for _ in range(3):
        edge.process.robots["max"].runner.crashed(ZeroDivisionError("oops"))
        await asyncio.sleep(0.05)
        edge.process.robots["max"].runner.restart()
    (reply,) = await asyncio.to_thread(command, bus_session, place, "rex", MOVE)
    assert reply.ok
    assert place.words("rex").count("run") == 1


async def test_the_end_of_the_edge_stops_who_moves_and_leaves_nothing_behind(yard, run_edge, requests):
    place = yard(rex=HERE, max=HERE)
    threads, handlers = set(threading.enumerate()), list(logging.getLogger("fleet.robot").handlers)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: len(place.words()) == 2)
        bus_session = await asyncio.to_thread(place.bus_session)
        (reply,) = await asyncio.to_thread(command, bus_session, place, "rex", GOTO, "navigate")
        assert reply.ok
        await asyncio.to_thread(bus_session.close)
    assert place.words("rex")[-2:] == ["halt", "stop"]
    assert place.words("max") == ["run"]
    left = {thread for thread in set(threading.enumerate()) - threads if not thread.name.startswith(POOLS)}
    assert left == set()
    assert logging.getLogger("fleet.robot").handlers == handlers
    assert [task for task in asyncio.all_tasks() if task is not asyncio.current_task()] == []
    assert not any(path.is_socket() and answers(path) for path in place.runtime.iterdir())


def answers(path: Path) -> bool:
    """Return True when somebody listens on a Unix socket."""
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(str(path)) == 0


async def test_an_edge_that_cannot_be_built_lets_go_of_the_bus(yard, monkeypatch):
    place = yard(rex=HERE)
    monkeypatch.setattr("fleet.host.edge.edge.bridge_of", lambda *_, **_more: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        place.edge()
    with pytest.raises(BusError):
        await asyncio.to_thread(place.bus_session)


async def test_an_edge_that_cannot_start_still_lets_go_of_everything(yard, monkeypatch):
    place = yard(rex=HERE)
    edge = place.edge()
    monkeypatch.setattr(edge, "_declare", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        await edge.run(asyncio.Event())
    with pytest.raises(BusError):
        await asyncio.to_thread(place.bus_session)


def test_ctrl_c_ends_a_real_edge_in_order(yard):
    place = yard(rex=HERE, arm={})
    command_line = [sys.executable, "-m", "fleet", "run", str(place.file)]
    with subprocess.Popen(command_line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as edge:
        try:
            wait_until("both robots run", lambda: len(place.words()) == 2)
            edge.send_signal(signal.SIGINT)
            assert edge.wait(60) == 0
        finally:
            edge.kill()
        assert "Traceback" not in edge.stderr.read()
    wait_until("the worker is gone", lambda: not psutil.pid_exists(place.processes("arm")[0]))


async def test_an_emergency_stop_survives_the_edges_violent_death(yard, run_edge, requests):
    place = yard(rex=HERE)
    line = [sys.executable, "-m", "fleet", "run", str(place.file)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(line, **quiet) as dying:  # noqa: ASYNC220 - it is not waited for here
        await requests.until(lambda: place.words() == ["run"], 60)
        bus_session = await asyncio.to_thread(place.bus_session)
        assert await asyncio.to_thread(request, bus_session, keys.stop(place.id))
        await requests.until(lambda: "stop" in place.words())
        family = [psutil.Process(dying.pid), *psutil.Process(dying.pid).children(recursive=True)]
        for process in family:  # its supervisor first: nobody starts it again
            process.kill()
        psutil.wait_procs(family, 60)
        await asyncio.to_thread(bus_session.close)
    edge = place.edge()
    async with run_edge(edge):
        (state,) = edge.states()
        assert state.emergency_stop
        bus_session = await asyncio.to_thread(place.bus_session)
        (refused,) = await asyncio.to_thread(command, bus_session, place, "rex", MOVE)
        assert "emergency stop is set (the stop key)" in refused.reason
        release = {"command": "release_emergency_stop"}
        assert (await asyncio.to_thread(command, bus_session, place, "rex", release))[0].ok
        await asyncio.to_thread(bus_session.close)
    later = place.edge()
    async with run_edge(later):
        assert not later.states()[0].emergency_stop


async def test_an_edge_that_the_broker_does_not_let_hear_its_commands_says_so(yard, run_edge):
    place = yard(rex={"worker": "main"})
    fleet = json.loads(place.file.read_text())
    place.file.write_text(json.dumps({**fleet, "cloud": {"host": "127.0.0.1", "port": 1, "tls": False}}))
    edge = place.edge()
    client = edge.bridge.client
    client.state = CloudState.CONNECTED
    for client.cause in ("the broker refuses the subscription T command (NOT_AUTHORIZED)", ""):
        assert edge.bridge.health == (Health(Level.DEGRADED, client.cause) if client.cause else Health())
    async with run_edge(edge):
        pass


async def test_an_edge_without_a_state_folder_runs_degraded_and_every_robot_is_stopped(
    yard, run_edge, requests, tmp_path
):
    place = yard(rex=HERE, arm={})
    (tmp_path / "file").write_text("")
    place.change(edge={"spool": {"path": str(tmp_path / "file" / "state")}})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.reachable for state in edge.states()))
        assert "the journal of commands is not kept: cannot create" in edge.state().cause
        assert [state.emergency_stop for state in edge.states()] == [True, True]
        bus_session = await asyncio.to_thread(place.bus_session)
        (refused,) = await asyncio.to_thread(command, bus_session, place, "rex", MOVE)
        assert "whether a stop was set is unknown" in refused.reason
        assert (
            await asyncio.to_thread(command, bus_session, place, "rex", {"command": "release_emergency_stop"})
        )[0].ok
        assert (await asyncio.to_thread(command, bus_session, place, "rex", MOVE))[0].ok
        await asyncio.to_thread(bus_session.close)
