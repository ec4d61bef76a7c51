"""A lease service on one of the two computers is no standby, and is not called so."""

import socket

import pytest

from fleet.config.other_edges import LeaseConfig
from fleet.doctor.finding import Rating
from fleet.doctor.pair import answers, check_files, check_pair, runs_here
from fleet.model.state import EdgeState

A, B, C = (f"tls://10.0.0.{number}:4222" for number in (1, 2, 3))


def judged(servers, *, here=(), silent=(), links=()):
    lease = LeaseConfig(servers=servers)
    found = check_pair(lease, links, here=lambda each: each in here, reached=lambda each: each not in silent)
    return [(each.verdict, each.found) for each in found]


@pytest.mark.parametrize(("servers", "here"), [((A,), (A,)), ((A, B), (A,)), ((A, B, C), (A, B))])
def test_a_service_that_dies_with_this_computer_is_no_standby(servers, here):
    (verdict, found), *_ = judged(servers, here=here)
    assert verdict is Rating.ERROR
    assert found.startswith("this is no standby")


@pytest.mark.parametrize(("servers", "here"), [((A,), ()), ((A, B, C), (A,))])
def test_a_service_that_outlives_this_computer_is_well(servers, here):
    assert [verdict for verdict, _ in judged(servers, here=here)] == [Rating.OK]


def test_a_service_that_does_not_answer_is_an_error():
    assert judged((A,), silent=(A,)) == [(Rating.ERROR, f"nothing answers at {A}")]


def test_links_of_this_computer_alone_are_named():
    links = ["serial:/dev/ttyUSB0?baud=9600", "tcp:10.0.0.7:5760", "my serial number"]
    ((verdict, found),) = judged((A,), links=links)
    assert (verdict, "ttyUSB0" in found, "5760" in found) == (Rating.WARNING, True, False)


def test_an_address_of_this_computer_is_known():
    assert runs_here("nats://localhost:4222")
    assert not runs_here("nats://192.0.2.1:4222")


def test_a_server_that_listens_answers():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        assert answers(f"nats://127.0.0.1:{port}")
    assert not answers(f"nats://127.0.0.1:{port}")


@pytest.mark.parametrize(
    ("files", "verdicts"),
    [
        ({"a": "1", "b": "1", "c": "2"}, [Rating.OK]),
        ({"a": "1", "b": "2"}, [Rating.ERROR]),
        ({"a": "1", "b": ""}, []),
        ({"a": "1"}, []),
    ],
)
def test_two_edges_with_different_files_are_named(files, verdicts):
    states = [EdgeState(name, "0", 0.0, 0.0, pair_file=file) for name, file in files.items()]
    found = check_files(("a", "b"), states)
    assert [each.verdict for each in found] == verdicts
    assert all("neither takes over" in each.found for each in found if each.verdict is Rating.ERROR)
