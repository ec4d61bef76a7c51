"""Ports that are taken, brokers that are away or shown with a wrong certificate, endpoints of others."""

import contextlib
import socket
import ssl
import threading
from datetime import UTC, datetime, timedelta

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.config.edge_section import EdgeConfig
from fleet.config.schema import BusConfig, CloudConfig, Sections
from fleet.doctor.finding import Rating
from fleet.doctor.network import EdgePort, check_broker, check_endpoints, check_ports, ports_of, taken_ports

NOW = datetime.now(UTC)


def test_the_ports_of_a_fleet_file_are_those_it_opens_itself():
    config = Sections(
        edge=EdgeConfig(id="yard-1"),
        bus=BusConfig(listen=("tcp/127.0.0.1:7447",), insecure="local"),
        metrics={"port": 9464},
        console={"port": 0},
    )
    links = ["udpin:0.0.0.0:14550", "udpin:0.0.0.0:0", "udpout:10.0.0.1:14551", "tcp:10.0.0.1:5760"]
    assert {(port.protocol, port.number) for port in ports_of(config, links)} == {
        ("udp", 14550),
        ("tcp", 9464),
        ("tcp", 7447),
    }


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


def test_a_port_that_another_program_has_is_an_error_with_the_way_to_find_it(listener):
    number = listener.getsockname()[1]
    (found,) = check_ports([EdgePort("tcp", number, "metrics")], taken_ports(), running=False)
    assert (found.verdict, f"sport = :{number}" in found.cure) == (Rating.ERROR, True)


def test_while_the_edge_runs_its_own_ports_are_expected_to_be_open(listener):
    mine = EdgePort("tcp", listener.getsockname()[1], "metrics")
    (found,) = check_ports([mine], taken_ports(), running=True)
    assert found.verdict is Rating.OK
    (missing,) = check_ports([EdgePort("udp", 1, "udpin:0.0.0.0:1")], set(), running=True)
    assert missing.verdict is Rating.WARNING


@contextlib.contextmanager
def broker(folder, *, host="127.0.0.1", days=365.0):
    """Serve TLS with a certificate for a host; yield the settings that reach it."""
    authority = make_authority("site", NOW - timedelta(days=1))
    pair = issue_pair(
        authority, Identity("broker", "edge", (host,), NOW + timedelta(days=days)), NOW - timedelta(hours=1)
    )
    for name, content in (("ca", authority.certificate), ("cert", pair.certificate), ("key", pair.key)):
        (folder / name).write_bytes(content)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "cert", folder / "key")
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve():
            with contextlib.suppress(OSError):
                opened, _ = listener.accept()
                with (
                    contextlib.suppress(OSError),
                    opened,
                    context.wrap_socket(opened, server_side=True) as tls,
                ):
                    tls.recv(1)

        thread = threading.Thread(target=serve)
        thread.start()
        yield CloudConfig(host="127.0.0.1", port=listener.getsockname()[1], ca_file=folder / "ca")
    thread.join(20)


def test_a_broker_that_is_trusted_is_ok_with_the_end_of_its_certificate(tmp_path):
    with broker(tmp_path) as cloud:
        found = check_broker(cloud, NOW)
    assert (found.verdict, "trusted until" in found.found) == (Rating.OK, True)


def test_a_certificate_that_ends_soon_is_a_warning(tmp_path):
    with broker(tmp_path, days=10) as cloud:
        found = check_broker(cloud, NOW)
    assert (found.verdict, "expires in" in found.found) == (Rating.WARNING, True)


def test_a_certificate_of_another_host_is_an_error(tmp_path):
    with broker(tmp_path, host="broker.example") as cloud:
        found = check_broker(cloud, NOW)
    assert (found.verdict, "not trusted" in found.found) == (Rating.ERROR, True)


def test_a_broker_that_is_away_is_an_error(listener):
    port = listener.getsockname()[1]
    listener.close()
    found = check_broker(CloudConfig(host="127.0.0.1", port=port), NOW)
    assert (found.verdict, "not reached" in found.found) == (Rating.ERROR, True)


def test_a_broker_without_a_name_is_reported_as_such(monkeypatch):
    def nobody(*_):
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "create_connection", nobody)
    found = check_broker(CloudConfig(host="broker.example"), NOW)
    assert "broker.example has no address" in found.found


def test_a_broker_without_encryption_is_reached(listener):
    cloud = CloudConfig(host="127.0.0.1", port=listener.getsockname()[1], tls=False)
    assert check_broker(cloud, NOW).verdict is Rating.OK


def test_endpoints_of_others_are_tried_and_those_of_udp_cannot_be(listener):
    port = listener.getsockname()[1]
    (there,) = check_endpoints([f"tcp/127.0.0.1:{port}"])
    listener.close()
    away, hidden = check_endpoints([f"tls/127.0.0.1:{port}", "quic/127.0.0.1:7447"])
    assert [each.verdict for each in (there, away, hidden)] == [Rating.OK, Rating.ERROR, Rating.UNKNOWN]
