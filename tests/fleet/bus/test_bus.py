import os
import queue
import select
import signal
import subprocess

import psutil
import pytest

from fleet.bus.bus import join, join_control, open_edge
from fleet.bus.settings import BusSettings, BusTls
from fleet.bus.zenoh_session import ZenohSession
from fleet.errors import BusError
from tests.tools.waiting import DEADLINE, wait_until

STOPS = 40
FLOOD = 20_000


def test_by_default_nothing_listens_but_sockets_of_this_user(spawn_edge):
    process = psutil.Process(spawn_edge().pid)
    assert [place.laddr for place in process.net_connections(kind="inet")] == []


def test_a_program_that_lets_strangers_in_does_not_have_the_edge_call_them(
    directory, edge, opened, free_port, sees
):
    peer = {"mode": "peer", "scouting/multicast/enabled": False}
    there = f"tcp/127.0.0.1:{free_port}"
    stranger = opened(ZenohSession({**peer, "listen/endpoints": [there]}))
    ours = f"unixsock-stream/{directory}/yard.reports.sock"
    opened(
        ZenohSession({**peer, "listen/endpoints": ["tcp/127.0.0.1:0"], "connect/endpoints": [ours, there]})
    )
    edge.control.token("fleet/yard")
    sees(stranger, "fleet/yard")  # over the program: by now each has told the others whom it knows
    assert all(end.startswith("unixsock-stream/") for end in edge.reports.reached())


def test_a_second_edge_of_the_same_id_is_refused(directory, edge):
    with pytest.raises(
        BusError,
        match=r"edge 'yard' runs already on this machine \(fleet ps\); stop it, or change edge.id",
    ):
        open_edge(BusSettings("yard"), directory)


def test_an_edge_whose_sockets_were_removed_says_that_programs_do_not_find_it(directory, edge):
    assert edge.removed == ""
    (directory / "yard.control.sock").unlink()
    assert "yard.control.sock was removed, as at a logout" in edge.removed
    assert "only fleet stop finds this edge until it is restarted" in edge.removed


def test_an_edge_of_another_id_runs_beside_it(directory, opened, edge):
    opened(open_edge(BusSettings("barn"), directory))


def test_a_frozen_edge_keeps_its_place(directory, spawn_edge):
    process = spawn_edge()
    os.kill(process.pid, signal.SIGSTOP)
    with pytest.raises(BusError, match="runs already"):
        open_edge(BusSettings("yard"), directory)


def test_nobody_waits_long_for_a_frozen_edge(directory, spawn_edge):
    os.kill(spawn_edge().pid, signal.SIGSTOP)
    with pytest.raises(BusError, match=r"cannot join the bus at unixsock-stream/.*: peer down or frozen"):
        join_control(BusSettings("yard"), directory)


def test_what_a_killed_edge_left_is_cleared_away(directory, opened, spawn_edge):
    process = spawn_edge()
    process.kill()
    process.wait()
    assert (directory / "yard.control.sock").exists()
    opened(open_edge(BusSettings("yard"), directory))
    opened(join(BusSettings("yard"), directory))


def test_a_child_of_an_edge_that_outlives_it_does_not_keep_the_next_one_out(directory, edge):
    has = subprocess.run(
        ["ls", "-l", "/proc/self/fd"], check=False, close_fds=False, stdout=subprocess.PIPE, text=True
    )
    assert "pipe" in has.stdout
    assert str(directory) not in has.stdout


def test_an_edge_that_does_not_run_cannot_be_joined(directory):
    with pytest.raises(BusError, match=r"edge 'yard' does not run here; start it, or set bus.connect"):
        join(BusSettings("yard"), directory)


def test_a_bad_endpoint_leaves_nothing_open(directory, opened):
    with pytest.raises(BusError, match="the bus cannot be opened"):
        open_edge(BusSettings("yard", listen=("tcp/203.0.113.9:7447",)), directory)
    opened(open_edge(BusSettings("yard"), directory))


@pytest.mark.parametrize("place", ["tcp/127.0.0.1:{port}", "unixsock-stream/{directory}/more"])
def test_both_lanes_are_reached_over_an_endpoint_of_the_fleet_file(directory, opened, free_port, place, sees):
    endpoint = place.format(port=free_port, directory=directory)
    edge = opened(open_edge(BusSettings("yard", listen=(endpoint,)), directory))
    edge.control.token("fleet/yard")
    away = opened(join(BusSettings("elsewhere", connect=(endpoint,)), directory))
    sees(away.control, "fleet/yard")


def test_a_worker_beside_its_edge_does_not_need_the_network(directory, opened):
    settings = BusSettings("yard", connect=("tcp/127.0.0.1:1",))
    opened(open_edge(settings, directory))
    opened(join(settings, directory))


def test_only_who_knows_the_password_comes_in(directory, opened, free_port, sees):
    known = BusSettings("yard", listen=(f"tcp/127.0.0.1:{free_port}",), user="anna", password="secret")
    edge = opened(open_edge(known, directory))
    edge.control.token("fleet/yard")
    assert not list(directory.glob("users*")), "the password is left on the disk"
    there = (f"tcp/127.0.0.1:{free_port}",)
    for connect in ((), there):
        name = "away" if connect else "yard"
        bus_session = opened(
            join_control(BusSettings(name, connect=connect, user="anna", password="secret"), directory)
        )
        sees(bus_session, "fleet/yard")
        for user, password in (("anna", "guess"), ("bob", "secret"), (None, None)):
            with pytest.raises(BusError, match="cannot join the bus"):
                join_control(BusSettings(name, connect=connect, user=user, password=password), directory)


def test_an_edge_that_its_router_does_not_let_in_says_so(directory, opened, free_port):
    hub = BusSettings(
        "hub", mode="router", listen=(f"tcp/127.0.0.1:{free_port}",), user="anna", password="secret"
    )
    there = {"connect": (f"tcp/localhost:{free_port}",), "user": "anna"}
    knows, guesses = (
        opened(open_edge(BusSettings(name, password=password, **there), directory))
        for name, password in (("yard", "secret"), ("barn", "guess"))
    )
    assert "cannot join the bus at tcp/localhost" in knows.problem
    opened(open_edge(hub, directory))
    wait_until("the router lets in who knows", lambda: not knows.problem)
    assert "its user, password or TLS settings differ" in guesses.problem


def test_both_lanes_of_an_edge_with_a_password_meet(directory, opened, sees):
    edge = opened(open_edge(BusSettings("yard", user="anna", password="secret"), directory))
    edge.control.token("fleet/yard")
    sees(edge.reports, "fleet/yard")


def test_a_second_edge_does_not_need_the_password_to_be_refused(directory, opened):
    opened(open_edge(BusSettings("yard", user="anna", password="secret"), directory))
    with pytest.raises(BusError, match="runs already"):
        open_edge(BusSettings("yard"), directory)


def test_edges_that_are_clients_meet_at_their_router(directory, opened, free_port, spawn_edge, sees):
    clients = [
        opened(
            open_edge(BusSettings(name, mode="client", connect=(f"tcp/127.0.0.1:{free_port}",)), directory)
        )
        for name in ("yard", "barn")
    ]
    heard = queue.Queue()
    clients[1].reports.subscribe("cw/**", lambda *sample: heard.put(sample))
    clients[0].control.token("fleet/yard")
    spawn_edge("hub", mode="router", listen=[f"tcp/127.0.0.1:{free_port}"])  # the router comes last
    sees(clients[1].control, "fleet/yard")
    wait_until("a report crosses", lambda: clients[0].reports.put("cw/x/data/y", b"1") or not heard.empty())


def test_a_reader_that_is_stuck_never_delays_a_stop(directory, edge, spawn_slow_reader):
    reader = spawn_slow_reader()
    publisher = edge.reports.publisher("cw/x/data/position")

    def flood():
        for _ in range(FLOOD // STOPS):
            publisher.put(b"x" * 1000)

    wait_until("it is stuck in its first report", lambda: flood() or has_line(reader, wait=0.0))
    assert reader.stdout.readline() == "report\n"
    for number in range(STOPS):
        flood()
        edge.control.put("fleet/yard/stop", str(number).encode(), urgent=True)
        assert has_line(reader, wait=DEADLINE)
        assert reader.stdout.readline() == f"stop {number}\n"


def has_line(process, *, wait):
    """Return whether a process has said something, for as long as ``wait`` seconds."""
    return bool(select.select([process.stdout], [], [], wait)[0])


@pytest.fixture
def certificates(directory, program):
    """Make an authority, and a certificate that it signed."""

    def openssl(*arguments):
        subprocess.run([program("openssl"), *arguments], cwd=directory, check=True, capture_output=True)

    new = (
        "req",
        "-x509",
        "-newkey",
        "ec",
        "-pkeyopt",
        "ec_paramgen_curve:prime256v1",
        "-nodes",
        "-days",
        "2",
    )
    openssl(*new, "-subj", "/CN=ca", "-keyout", "ca.key", "-out", "ca.pem")
    name = ("-subj", "/CN=yard", "-addext", "subjectAltName=IP:127.0.0.1,DNS:localhost")
    signed = ("-CA", "ca.pem", "-CAkey", "ca.key", "-addext", "basicConstraints=critical,CA:FALSE")
    openssl(*new, *name, *signed, "-keyout", "yard.key", "-out", "yard.pem")
    return BusTls(*(str(directory / name) for name in ("ca.pem", "yard.pem", "yard.key")), mutual=True)


def test_only_who_shows_a_certificate_comes_in(directory, opened, free_port, certificates, sees):
    there = f"tls/127.0.0.1:{free_port}"
    edge = opened(open_edge(BusSettings("yard", listen=(there,), tls=certificates), directory))
    edge.control.token("fleet/yard")
    bus_session = opened(join_control(BusSettings("away", connect=(there,), tls=certificates), directory))
    sees(bus_session, "fleet/yard")
    bare = BusTls(root_ca=certificates.root_ca)
    with pytest.raises(BusError, match="cannot join the bus at tls"):
        join_control(BusSettings("away", connect=(there,), tls=bare), directory)
