"""What a worker process knows of its edge."""

import contextlib
import os
import socket

import pytest

from fleet.host.workers.worker_process import edge_lives
from fleet.supervisor import protocol
from fleet.supervisor.client import SupervisorClient
from fleet.supervisor.protocol import OrderlyEnd, Welcome
from tests.tools.waiting import wait_until


@pytest.fixture
def supervisor():
    """Give the supervisor's end of a worker's connection, the worker's client, and why it has to end."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.send(protocol.encode(Welcome()))
    client, ended = SupervisorClient(ours), []
    client.begin("yard", "arm", stop=lambda _requested: [], end=ended.append)
    with contextlib.closing(theirs), contextlib.closing(client):
        yield theirs, client, ended


def test_an_edge_lives_while_it_is_the_parent_of_the_worker(supervisor):
    _, client, _ = supervisor
    assert edge_lives(client, os.getppid())
    assert not edge_lives(client, os.getpid()), "the kernel has given the worker another parent"


def test_the_edge_of_a_worker_on_another_computer_is_no_parent(supervisor):
    _, client, _ = supervisor
    assert edge_lives(client, None)


def test_an_edge_whose_death_the_supervisor_saw_is_dead_though_it_is_still_the_parent(
    supervisor,
):
    theirs, client, ended = supervisor
    theirs.send(protocol.encode(OrderlyEnd()))
    wait_until("the worker has to end", lambda: ended == ["the edge is gone"])
    assert not edge_lives(client, os.getppid())


def test_the_worker_knows_before_it_has_to_end_which_ends_the_commands():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.send(protocol.encode(Welcome()))
    client, known = SupervisorClient(ours), []
    client.begin(
        "yard", "arm", stop=lambda _requested: [], end=lambda _why: known.append(edge_lives(client, None))
    )
    with contextlib.closing(theirs), contextlib.closing(client):
        theirs.send(protocol.encode(OrderlyEnd()))
        wait_until("the worker has to end", lambda: known == [False])
