"""A pair in fleet.yaml: which edge this computer is, and what a pair cannot have."""

import pytest

from fleet.config.difference import outline_of
from fleet.config.edge_id import EDGE_ID

PAIR = "pair: [a, b]\nlease: {servers: ['tls://lease.example.com:4222']}\n"
ROBOTS = "robots:\n  - {name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy, link: %s%s}\n"


def text(head=PAIR, link="'tcp:10.0.0.7:5760'", more=""):
    return head + ROBOTS % (link, more)


@pytest.mark.parametrize(("environ", "edge"), [({}, "a"), ({EDGE_ID: "a"}, "a"), ({EDGE_ID: "b"}, "b")])
def test_the_environment_says_which_edge_this_computer_is(yard, environ, edge):
    loaded = yard.load(text(), environ)
    assert loaded.config.edge.id == edge
    assert loaded.warnings == ()


def test_what_else_is_said_of_the_edge_holds_for_both(yard):
    loaded = yard.load(text("edge: {spool: {size: 32}}\n" + PAIR), {EDGE_ID: "b"})
    assert (loaded.config.edge.id, loaded.config.edge.spool.size) == ("b", 32)


def test_the_variable_means_nothing_where_there_is_no_pair(yard):
    assert yard.load(text("edge: {id: e}\n"), {EDGE_ID: "b"}).config.edge.id == "e"


@pytest.mark.parametrize(
    ("head", "environ", "problem"),
    [
        (PAIR, {EDGE_ID: "c"}, "this computer is to be 'c', which is not in pair"),
        ("edge: {id: e}\n" + PAIR, {}, "leave edge.id out"),
        ("pair: [a, b]\n", {}, "a pair needs the lease service"),
        ("edge: {id: e}\nlease: {servers: ['tls://h:4222']}\n", {}, "a lease is for a pair of edges"),
        ("pair: [a, a]\nlease: {servers: ['tls://h:4222']}\n", {}, "a pair is two edges"),
        ("pair: [a, b, c]\nlease: {servers: ['tls://h:4222']}\n", {}, "pair"),
        ("pair: [a, b]\nlease: {servers: ['nats://h:4222']}\n", {}, "is not encrypted"),
        ("pair: [a, b]\nlease: {servers: ['http://h']}\n", {}, "is no server"),
        ("pair: [a, b]\nlease: {servers: []}\n", {}, "lease.servers"),
        (
            "pair: [a, b]\nlease: {servers: ['tls://h:4222'], user: u}\n",
            {},
            "user and password come together",
        ),
        (PAIR + "remote_workers: [far]\n", {}, "workers on other computers"),
    ],
)
def test_what_a_pair_cannot_have_is_reported(yard, head, environ, problem):
    assert any(problem in each for each in yard.problems(text(head), environ))


def test_a_robot_in_a_worker_is_refused(yard):
    (problem,) = yard.problems(text(more=", worker: arms"))
    assert "runs in a worker, which the lease of a pair does not reach" in problem


@pytest.mark.parametrize("link", ["'serial:/dev/ttyUSB0?baud=115200'", "'can:socketcan:can0'", "'sim:toy'"])
def test_a_robot_that_only_one_computer_reaches_is_named(yard, link):
    (warning,) = yard.load(text(link=link)).warnings
    assert "rex has no standby: only one computer can open" in str(warning)


def test_the_lease_service_may_be_plain_where_that_is_said(yard):
    lease = "pair: [a, b]\nlease: {servers: ['nats://10.0.0.9:4222'], insecure: true}\n"
    assert yard.load(text(lease)).config.lease.servers == ("nats://10.0.0.9:4222",)


def test_a_changed_pair_is_a_difference(yard):
    outlines = [outline_of(yard.load(text(head))) for head in (PAIR, PAIR.replace("lease.ex", "other.ex"))]
    assert outlines[0].sections["lease"] != outlines[1].sections["lease"]
