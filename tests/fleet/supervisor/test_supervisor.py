"""The supervisor of a process that is a few lines long: what it passes on, and what it does not believe."""

import contextlib
import os
import shutil
import socket
import sys
import tempfile
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fleet.clock import SystemClock
from fleet.supervisor import protocol
from fleet.supervisor.client import SupervisorClient
from fleet.supervisor.protocol import RegisterHalt, StopAnswer, StopRequest, Welcome
from fleet.supervisor.service_manager import ServiceManager
from fleet.supervisor.sockets import connected, socket_of
from fleet.supervisor.stop_request import stop_all
from fleet.supervisor.supervisor import Supervisor
from tests.tools.waiting import DEADLINE, wait_until

ENDS_ON_REQUEST = """
import socket, sys
with socket.socket(socket.AF_UNIX) as told:
    told.connect(sys.argv[1])
    told.recv(1)
sys.exit(3)
"""


class Field:
    """A supervisor on a thread, whose child ends with code 3 when it is told to."""

    def __init__(self, folder):
        self.folder = folder
        self.path = socket_of(folder / "run", os.getpid())
        self.other = socket_of(folder / "other", os.getpid())
        self.path.parent.mkdir()
        self.ending = socket.socket(socket.AF_UNIX)
        self.ending.bind(str(folder / "end"))
        self.ending.listen()
        self.lines, self.code = [], None
        command = [sys.executable, "-c", ENDS_ON_REQUEST, str(folder / "end")]
        self.supervisor = Supervisor(
            command, paths=[self.path, self.other], report=self.lines.append, clock=SystemClock()
        )
        self.thread = threading.Thread(target=self._run)
        self.thread.start()
        self.child, _ = self.ending.accept()

    def _run(self):
        self.code = self.supervisor.run()

    def end(self):
        self.supervisor._ending = True  # as after a signal: an edge that served its robots is not restarted
        self.child.close()
        self.thread.join(60)
        self.ending.close()
        assert not self.thread.is_alive()


@pytest.fixture
def field(monkeypatch):
    # Only a main thread may take signals; nobody sends this one any.
    monkeypatch.setattr("fleet.supervisor.supervisor.handled_signals", lambda _: contextlib.nullcontext())
    with tempfile.TemporaryDirectory() as folder:  # short: the path of a socket must be
        field = Field(Path(folder))
        yield field
        field.end()


def test_the_exit_code_is_the_edges_own(field):
    field.end()
    assert field.code == 3
    assert not field.path.exists()


def test_a_stop_still_reaches_it_when_its_runtime_folder_was_removed(field):
    shutil.rmtree(field.path.parent)
    wait_until("it listens again", field.path.exists)
    assert stop_all(field.path.parent, ("rex",))
    (line,) = field.lines
    assert f"{field.path} was removed, as at a logout" in line


def test_the_edge_gets_few_memory_arenas_so_that_its_memory_stays_flat(field):
    variables = Path(f"/proc/{field.supervisor._child.pid}/environ").read_bytes().split(b"\0")
    assert b"MALLOC_ARENA_MAX=" + os.environb.get(b"MALLOC_ARENA_MAX", b"2") in variables


def test_a_stop_without_an_edge_is_answered_as_kept_and_passed_to_the_next(field):
    (answer,) = stop_all(field.path.parent, ("rex",))
    assert (answer.kept, answer.names) == (True, ())
    with contextlib.closing(connected(field.path, within=5.0)) as edge:
        pid = field.supervisor._child.pid
        edge.send(protocol.encode(protocol.Hello("yard", process=pid)))
        welcome = protocol.decode(edge.recv(1000))
    assert isinstance(welcome, Welcome)
    assert [stop.names for stop in welcome.stops] == [("rex",)]


def test_a_stop_is_kept_until_an_edge_that_has_received_it_serves_its_robots(field):
    stop_all(field.path.parent, ("rex",))
    hello = protocol.encode(protocol.Hello("yard", process=field.supervisor._child.pid))
    for _ in range(2):  # the first edge dies before it has set the stop
        with contextlib.closing(connected(field.path, within=5.0)) as edge:
            edge.send(hello)
            assert [stop.names for stop in protocol.decode(edge.recv(1000)).stops] == [("rex",)]
    with contextlib.closing(connected(field.path, within=5.0)) as edge:
        edge.send(hello)
        edge.recv(1000)
        edge.send(protocol.encode(protocol.EdgeRunning()))
        wait_until("the edge has it", lambda: not field.supervisor._stops)


def test_a_worker_gets_no_stops_of_the_edge_and_does_not_take_them_away(field):
    stop_all(field.path.parent)
    with contextlib.closing(connected(field.path, within=5.0)) as worker:
        worker.send(protocol.encode(protocol.Hello("yard", worker="arm", process=1)))
        assert protocol.decode(worker.recv(1000)) == Welcome(())
    assert len(field.supervisor._stops) == 1


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(st.binary(min_size=1, max_size=200), st.just(protocol.encode(RegisterHalt("rex", (b"x",))))))
def test_whatever_it_is_sent_it_goes_on(field, data):
    with contextlib.closing(connected(field.path, within=5.0)) as somebody:
        somebody.send(data)
    (answer,) = stop_all(field.path.parent)
    assert isinstance(answer, StopAnswer)


def test_stops_that_are_asked_again_and_again_are_one_for_the_next_edge(field):
    for _ in range(3):
        stop_all(field.path.parent, ("rex",))
    assert [stop.names for stop in field.supervisor._stops] == [("rex",)]


@pytest.mark.parametrize("letter", ["x", "\0", "\U0001f600", "\udce9"])
def test_a_stop_with_a_long_reason_is_taken_and_the_reason_cut(field, letter):
    (answer,) = stop_all(field.path.parent, ("rex",), why=letter * 70_000, request=letter * 70_000)
    assert answer.kept
    (stop,) = field.supervisor._stops
    assert (stop.names, len(stop.why), len(stop.request)) == (("rex",), 200, 200)


def test_a_stop_of_more_names_than_fit_a_message_is_one_for_all(field):
    (answer,) = stop_all(field.path.parent, tuple(f"robot-{number}" for number in range(10_000)))
    assert answer.kept
    assert [stop.names for stop in field.supervisor._stops] == [()]


@pytest.mark.parametrize(
    "message",
    [
        b'{"type":"stop","names":["re',
        b"stop",
        b'{"type":"stop","names":["r\xe9x"]}',
        b'{"type":"stop","why":"\xff"}',
        protocol.encode(StopRequest(why="x" * 70_000)),
    ],
)
def test_what_cannot_be_read_of_who_has_no_robots_is_a_stop_for_all(field, message):
    with contextlib.closing(connected(field.path, within=5.0)) as somebody:
        somebody.send(message)
        assert protocol.decode(somebody.recv(1000)) == StopAnswer(kept=True)
    assert [stop.names for stop in field.supervisor._stops] == [()]


def test_what_cannot_be_read_of_a_worker_stops_nothing(field):
    with contextlib.closing(connected(field.path, within=5.0)) as worker:
        worker.send(protocol.encode(protocol.Hello("yard", worker="arm", process=1)))
        worker.recv(1000)
        worker.send(b"nonsense")
        wait_until("it is told", lambda: any("was refused" in line for line in field.lines))
    assert field.supervisor._stops == []


def test_a_name_that_is_no_text_holds_up_no_stop(field):
    (answer,) = stop_all(field.path.parent, ("rex", "r\udce9x"))
    assert answer.kept


def test_a_halt_whose_link_did_not_come_with_it_is_reported(field):
    with contextlib.closing(connected(field.path, within=5.0)) as worker:
        worker.send(protocol.encode(RegisterHalt("rex", (b"halt",))))
        wait_until("it is told", lambda: any("the link of rex did not come" in line for line in field.lines))


def test_a_halt_that_is_kept_is_answered_and_one_that_is_refused_is_not(field):
    kept = []
    worker = SupervisorClient(connected(field.path, within=5.0))
    worker.begin("yard", "arm", stop=lambda _names: [], end=lambda _why: None)
    worker._waiting[99] = lambda: kept.append("kept")
    worker._send(RegisterHalt("rex", (b"halt",), None, 99))
    wait_until("it is told", lambda: any("the link of rex did not come" in line for line in field.lines))
    ours, robot = socket.socketpair()
    with contextlib.closing(ours), contextlib.closing(robot):
        worker.register("max", ours.fileno(), [b"halt"], kept=lambda: kept.append("another"))
        wait_until("the next answer", lambda: bool(kept))
    assert kept == ["another"]
    worker.close()


def test_an_edge_whose_child_keeps_the_connection_open_is_dead_all_the_same(field):
    kept, robot = socket.socketpair()
    with contextlib.closing(connected(field.path, within=5.0)) as edge:
        edge.send(protocol.encode(protocol.Hello("yard", process=field.supervisor._child.pid)))
        edge.recv(1000)
        socket.send_fds(edge, [protocol.encode(RegisterHalt("rex", (b"halt",)))], [kept.fileno()])
        wait_until("it is kept", lambda: any(peer.halts.robots for peer in field.supervisor._peers))
        field.child.close()
        robot.settimeout(60)
        assert robot.recv(100).startswith(b"halt")
    kept.close()
    robot.close()


def test_systemd_hears_that_the_edge_is_ready_when_it_serves_its_robots_and_not_before(field):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(field.folder / "notify"))
        systemd.settimeout(DEADLINE)
        variables = {"NOTIFY_SOCKET": str(field.folder / "notify"), "WATCHDOG_USEC": "30000000"}
        field.supervisor._manager = ServiceManager(variables, 1)
        assert systemd.recv(100) == b"WATCHDOG=1"
        with contextlib.closing(connected(field.path, within=5.0)) as edge:
            pid = field.supervisor._child.pid
            edge.send(protocol.encode(protocol.Hello("yard", process=pid)))
            edge.send(protocol.encode(protocol.EdgeRunning()))
            assert systemd.recv(100).startswith(b"READY=1\n")
