"""The connection of a process to its supervisor: what it asks to be kept, and what it obeys."""

import asyncio
import os
import socket
import threading
from pathlib import Path

import pytest

from fleet.errors import StateError
from fleet.supervisor import client, protocol
from fleet.supervisor.client import BEAT, SupervisorClient, connect_supervisor
from fleet.supervisor.protocol import (
    EdgeRunning,
    HaltRegistered,
    HaltUnregistered,
    Hello,
    LeftNotice,
    OrderlyEnd,
    ProcessHeartbeat,
    RegisterHalt,
    StopAnswer,
    StopRequest,
    UnregisterHalt,
    Welcome,
    WriteUntil,
)
from fleet.supervisor.sockets import VARIABLE, listening
from tests.tools.waiting import wait_until


class Pair:
    """A process and its supervisor, whose part the test plays."""

    def __init__(self, folder):
        ours, self.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.theirs.settimeout(20)
        self.stops, self.ends = [], []
        self.client = SupervisorClient(ours, folder)
        self.send(Welcome())

    def begin(self, worker=""):
        self.client.begin("yard", worker, stop=self._stop, end=self.ends.append)
        return self

    def _stop(self, request):
        self.stops.append(request)
        return ["rex"]

    def send(self, message):
        self.theirs.send(message if isinstance(message, bytes) else protocol.encode(message))

    def heard(self):
        """Return the next message that is no heartbeat."""
        while True:
            message = protocol.decode(self.theirs.recv(protocol.LONGEST))
            if message != ProcessHeartbeat():
                return message

    def received(self):
        """Return the next message with the file that came along."""
        data, (file,), _, _ = socket.recv_fds(self.theirs, protocol.LONGEST, 1)
        return protocol.decode(data), file


@pytest.fixture
def pair(tmp_path):
    pair = Pair(tmp_path)
    yield pair
    pair.client.close()
    pair.theirs.close()


@pytest.fixture
def begun(pair):
    pair.begin()
    assert pair.heard() == Hello("yard", "", os.getpid())
    return pair


def test_it_introduces_itself_and_its_worker(pair):
    pair.begin("arm")
    assert pair.heard() == Hello("yard", "arm", os.getpid())
    assert pair.stops == []


def test_what_it_reports_arrives_in_order(begun):
    begun.client.running()
    begun.client.write_until(12.5)
    begun.client.ending()
    assert [begun.heard() for _ in range(3)] == [EdgeRunning(), WriteUntil(12.5), OrderlyEnd()]


def test_it_shows_that_it_is_not_frozen(begun):
    assert protocol.decode(begun.theirs.recv(1000)) == ProcessHeartbeat()
    assert BEAT <= 0.5, "the supervisor gives a frozen process a few of them"


def test_a_stop_is_obeyed_and_answered_with_its_number(begun):
    begun.send(StopRequest(("rex",), 7, why="smoke"))
    assert begun.heard() == StopAnswer(7, "yard", ("rex",))
    assert begun.stops == [StopRequest(("rex",), 7, why="smoke")]


@pytest.mark.parametrize("message", [b"nonsense", Welcome(), StopAnswer(1, "yard")])
def test_what_cannot_be_read_or_is_not_meant_for_it_keeps_no_stop_back(begun, message, caplog):
    begun.send(message)
    begun.send(StopRequest((), 8))
    assert begun.heard() == StopAnswer(8, "yard", ("rex",))
    assert "supervisor" in caplog.text


def test_a_stop_that_fails_keeps_the_next_one_not_back(begun, caplog):
    begun.client._stop = lambda _stop: 1 // 0
    begun.send(StopRequest((), 8))
    wait_until("it failed", lambda: "could not be handled" in caplog.text)
    begun.client._stop = begun._stop
    begun.send(StopRequest((), 9))
    assert begun.heard() == StopAnswer(9, "yard", ("rex",))


def test_a_halt_is_kept_once_the_supervisor_says_so(begun):
    kept = threading.Event()
    read, write = os.pipe()
    assert begun.client.register("rex", write, (b"halt",), ("host", 9), kept=kept.set)
    message, file = begun.received()
    assert message == RegisterHalt("rex", (b"halt",), ("host", 9), message.number)
    os.write(file, b"halt")
    assert os.read(read, 9) == b"halt", "it is the same link"
    for each in (read, write, file):
        os.close(each)
    begun.send(HaltRegistered(message.number + 1))
    begun.send(StopRequest((), 1))
    begun.heard()
    assert not kept.is_set(), "that was another"
    begun.send(HaltRegistered(message.number))
    assert kept.wait(20)


def test_a_link_without_a_descriptor_is_not_registered(begun):
    assert not begun.client.register("rex", -1, (b"halt",), kept=lambda: None)
    begun.client.running()
    assert begun.heard() == EdgeRunning()


def test_a_descriptor_that_is_closed_is_reported(begun, caplog):
    read, write = os.pipe()
    os.close(read)
    os.close(write)
    assert not begun.client.register("rex", write, (b"halt",), kept=lambda: None)
    assert "rex: its halt could not be registered with the supervisor" in caplog.text


async def test_a_dropped_link_may_be_opened_once_the_supervisor_has_closed_it(begun, monkeypatch):
    monkeypatch.setattr(client, "DROPPED_WITHIN", 60.0)
    drop = asyncio.ensure_future(begun.client.drop("rex"))
    message = await asyncio.to_thread(begun.heard)
    assert message == UnregisterHalt("rex", message.number)
    assert not drop.done()
    begun.send(HaltUnregistered(message.number))
    await asyncio.wait_for(drop, 20)


async def test_a_supervisor_that_does_not_answer_delays_the_link_only_so_long(begun, monkeypatch):
    monkeypatch.setattr(client, "DROPPED_WITHIN", 0.01)
    await asyncio.wait_for(begun.client.drop("rex"), 20)
    message = begun.heard()
    begun.send(HaltUnregistered(message.number))
    begun.send(StopRequest((), 1))
    assert begun.heard() == StopAnswer(1, "yard", ("rex",)), "a late answer is no error"


def test_a_notice_is_left_in_a_file_without_a_name(begun, tmp_path):
    begun.client.leave_notice(b"gone")
    message, file = begun.received()
    assert message == LeftNotice()
    assert os.pread(file, 99, 0) == b"gone"
    os.close(file)
    assert list(tmp_path.iterdir()) == []


def test_a_notice_that_cannot_be_left_is_reported(begun, caplog):
    begun.client._folder = Path("/nowhere")
    begun.client.leave_notice(b"gone")
    assert "the disconnect notice could not be left with the supervisor" in caplog.text


def test_a_worker_whose_edge_has_ended_ends_too(begun):
    begun.send(OrderlyEnd())
    wait_until("the end", lambda: begun.ends == ["the edge is gone"])


def test_one_that_closes_its_connection_itself_does_not_end_for_it(begun):
    begun.client.close()
    assert not begun.client._thread.is_alive()
    assert begun.ends == []
    begun.client.running()


def test_one_that_no_supervisor_started_runs_without():
    assert connect_supervisor({})._sock is None
    assert connect_supervisor({VARIABLE: ""})._sock is None


def test_one_whose_supervisor_is_gone_does_not_run(short_folder):
    with pytest.raises(StateError, match="the supervisor is gone: No such file or directory"):
        connect_supervisor({VARIABLE: str(short_folder / "supervisor-1.sock")})


def test_one_that_was_started_by_a_supervisor_is_connected_to_it(short_folder):
    with listening(short_folder / "supervisor-1.sock") as listener:
        supervised = connect_supervisor({VARIABLE: str(short_folder / "supervisor-1.sock")})
        listener.setblocking(True)
        there, _ = listener.accept()
        supervised.running()
        assert protocol.decode(there.recv(1000)) == EdgeRunning()
        supervised.close()
        there.close()


async def test_without_a_supervisor_nothing_is_kept_and_nothing_fails():
    alone = SupervisorClient()
    alone.begin("yard", stop=lambda _names: [], end=lambda _why: None)
    assert not alone.register("rex", 0, [b"halt"], kept=lambda: None)
    await alone.drop("rex")
    alone.running()
    alone.ending()
    alone.close()


def test_a_process_whose_supervisor_goes_ends():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.send(protocol.encode(Welcome((StopRequest(("rex",)),))))
    stopped, ended = [], []
    supervised = SupervisorClient(ours)
    supervised.begin(
        "yard", stop=lambda requested: stopped.append(requested.names) or ["rex"], end=ended.append
    )
    assert stopped == [("rex",)], "before anything is served"
    theirs.send(protocol.encode(StopRequest((), 7)))
    said = lambda: [protocol.decode(theirs.recv(1000)) for _ in range(1)]  # noqa: E731
    wait_until("the answer", lambda: StopAnswer(7, "yard", ("rex",)) in said())
    theirs.close()
    wait_until("the end", lambda: ended == ["the supervisor is gone"])
    supervised.close()


def test_a_process_that_nobody_welcomes_stops_all_its_robots():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.send(b"nonsense")
    stopped = []
    supervised = SupervisorClient(ours)
    supervised.begin(
        "yard", stop=lambda requested: stopped.append(requested.names) or [], end=lambda _why: None
    )
    assert stopped == [()]
    supervised.close()
    theirs.close()
