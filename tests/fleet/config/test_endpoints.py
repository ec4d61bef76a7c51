"""Which endpoints of the bus a stranger could use to command the robots."""

import pytest

from fleet.config.endpoints import (
    COMMON_NAME,
    LONGEST_SOCKET_PATH,
    Proof,
    check_locator,
    connecting_danger,
    folder_of,
    is_encrypted,
    is_local,
    is_unencrypted,
    listening_danger,
    scouting_danger,
    shared_folder_danger,
    socket_too_long,
)

NONE = Proof(password=False, certificates=False, mutual=False)
PASSWORD = Proof(password=True, certificates=False, mutual=False)
TLS = Proof(password=False, certificates=True, mutual=False)
MUTUAL = Proof(password=False, certificates=True, mutual=True)

SOCKET, SERIAL, PIPE = "unixsock-stream//run/fleet.sock", "serial//dev/ttyS0", "unixpipe/fleet"
HERE = ("tcp/127.0.0.1:7447", "udp/[::1]:7447", "ws/localhost:80", PIPE, "vsock/1:7447")
NETWORK = (
    "tcp/192.168.1.10:7447",
    "udp/[2001:db8::1]:7447",
    "tcp/0.0.0.0:7447",
    "ws/edge.local:80",
    "tcp/[::]:7447",
)
ENCRYPTED = ("tls/edge.local:7447", "quic/192.168.1.10:7447")


@pytest.mark.parametrize(
    "endpoint", [SOCKET, SERIAL, *HERE, *NETWORK, *ENCRYPTED, "tcp/h:1?prio=1#iface=eth0"]
)
def test_an_endpoint_of_zenoh_is_taken_as_it_is(endpoint):
    assert check_locator(endpoint) == endpoint


@pytest.mark.parametrize(
    "endpoint", ["", "tcp/", "192.168.1.10:7447", "http/h:1", "tcp/h:1 x", " tcp/h:1", "TCP/h:1"]
)
def test_what_is_no_endpoint_is_refused_with_an_example(endpoint):
    with pytest.raises(ValueError, match=r"must be an endpoint like tcp/192\.168\.1\.10:7447"):
        check_locator(endpoint)


@pytest.mark.parametrize(
    "option",
    [
        "enable_mtls=false",
        "verify_name_on_connect=false",
        "root_ca_certificate_file=x",
        "listen_private_key=x",
        "connect_certificate_base64=x",
    ],
)
def test_an_encrypted_endpoint_cannot_undo_what_tls_says_for_all(option):
    name = option.partition("=")[0]
    for endpoint in (f"tls/h:1#{option}", f"quic/h:1?a=b#c=d;{option}"):
        with pytest.raises(ValueError, match=f"{name} cannot be set for one endpoint"):
            check_locator(endpoint)
    assert check_locator(f"tcp/h:1#{option}")


@pytest.mark.parametrize(("size", "fits"), [(LONGEST_SOCKET_PATH, True), (LONGEST_SOCKET_PATH + 1, False)])
def test_the_path_of_a_socket_is_bounded_in_bytes(size, fits):
    for endpoint in (f"unixsock-stream/{'x' * size}", f"unixsock-stream/{'x' * size}?a=b#c"):
        assert (socket_too_long(endpoint, LONGEST_SOCKET_PATH) == "") is fits
    umlaut = f"unixsock-stream/{chr(228) * (size // 2)}{'x' * (size % 2)}"
    assert (socket_too_long(umlaut, LONGEST_SOCKET_PATH) == "") is fits
    if not fits:
        with pytest.raises(
            ValueError, match="the path has 108 bytes, and that of a Unix socket may have 107"
        ):
            check_locator(umlaut)


def test_the_length_of_other_endpoints_is_not_bounded():
    assert socket_too_long(f"tcp/{'x' * 500}:1", 100) == ""


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "127.8.8.8", "::1", "[::1]"])
def test_this_computer_has_several_names(host):
    assert is_local(host)


@pytest.mark.parametrize(
    "host", ["", "0.0.0.0", "::", "192.168.1.10", "localhost.example.com", "127.0.0.1.example.com", "fleet"]
)
def test_any_other_name_may_be_another_computer(host):
    assert not is_local(host)


@pytest.mark.parametrize("endpoint", ENCRYPTED)
def test_an_encrypted_endpoint_needs_proof_of_who_connects_to_it_or_a_password(endpoint):
    assert is_encrypted(endpoint)
    assert listening_danger(endpoint, MUTUAL, insecure=False) == ""
    assert listening_danger(endpoint, PASSWORD, insecure=False) == ""
    danger = listening_danger(endpoint, TLS, insecure=False)
    assert danger == (
        "anyone on the network could command the robots over it; "
        "set tls: with mutual: true, or user: and password:, or insecure: true"
    )


@pytest.mark.parametrize("endpoint", ENCRYPTED)
def test_who_answers_at_an_encrypted_endpoint_has_proven_it(endpoint):
    assert connecting_danger(endpoint, TLS, insecure=False) == ""


@pytest.mark.parametrize("endpoint", NETWORK)
@pytest.mark.parametrize("proof", [NONE, TLS, MUTUAL])
def test_a_plain_endpoint_on_the_network_is_open_to_all_unless_it_is_said(endpoint, proof):
    for danger in (listening_danger, connecting_danger):
        for insecure in (False, "local"):
            assert danger(endpoint, proof, insecure).startswith("anyone on the network could ")
            assert "set a tls/ endpoint with tls:, or user: and password:" in danger(
                endpoint, proof, insecure
            )
        assert danger(endpoint, proof, insecure=True) == ""
        assert danger(endpoint, PASSWORD, insecure=False) == ""


@pytest.mark.parametrize("endpoint", HERE)
def test_an_endpoint_on_this_computer_is_open_to_its_users_unless_it_is_said(endpoint):
    for danger in (listening_danger, connecting_danger):
        assert danger(endpoint, MUTUAL, insecure=False).startswith("every user of this computer could ")
        assert "or insecure: local" in danger(endpoint, NONE, insecure=False)
        assert [danger(endpoint, NONE, insecure) for insecure in ("local", True)] == ["", ""]
        assert danger(endpoint, PASSWORD, insecure=False) == ""


@pytest.mark.parametrize("endpoint", [SOCKET, SERIAL])
def test_a_file_is_guarded_by_its_permissions(endpoint):
    assert listening_danger(endpoint, NONE, insecure=False) == ""
    assert connecting_danger(endpoint, NONE, insecure=False) == ""


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1", "tcp/evil:1?x=127.0.0.1:1", "tcp/evil:1#x=/127.0.0.1:1"]
)
def test_what_only_looks_local_is_not(endpoint):
    assert listening_danger(endpoint, NONE, "local").startswith("anyone on the network")


@pytest.mark.parametrize(
    ("endpoints", "proof", "insecure", "is_safe"),
    [
        ((), NONE, False, False),
        ((), NONE, "local", False),
        ((), NONE, True, True),
        ((), PASSWORD, False, False),
        ((), TLS, False, True),
        ((SOCKET, *ENCRYPTED), TLS, False, True),
        ((*ENCRYPTED, "tcp/127.0.0.1:1"), TLS, False, False),
        ((*ENCRYPTED, "tcp/127.0.0.1:1"), TLS, True, True),
    ],
)
def test_peers_found_by_multicast_need_certificates_on_every_endpoint(endpoints, proof, insecure, is_safe):
    assert (scouting_danger(endpoints, proof, insecure) == "") is is_safe


def test_the_endpoint_that_keeps_announced_peers_from_proving_themselves_is_named():
    assert "set tls:, and no ws/ endpoint, or insecure" in scouting_danger(
        ("tls/h:1", "ws/h:1"), TLS, insecure=False
    )
    assert "set tls: or insecure" in scouting_danger(("ws/h:1",), NONE, insecure=False)


@pytest.mark.parametrize(
    ("endpoint", "folder"),
    [
        (SOCKET, "/run"),
        ("unixsock-stream//fleet.sock", "/"),
        ("unixsock-stream//a/b/c.sock?x=/y#z=/w", "/a/b"),
        ("tcp/h:1", ""),
        (SERIAL, ""),
    ],
)
def test_the_folder_of_a_socket_is_that_of_its_path(endpoint, folder):
    assert folder_of(endpoint) == folder


def test_a_socket_in_a_folder_of_all_users_can_be_replaced_by_any_of_them():
    danger = shared_folder_danger("unixsock-stream//tmp/x", MUTUAL, insecure=False)
    assert danger.startswith("every user of this computer may write to /tmp and put another socket there")
    assert shared_folder_danger("unixsock-stream//tmp/x", PASSWORD, insecure=False) == ""
    assert [
        shared_folder_danger("unixsock-stream//tmp/x", NONE, insecure) for insecure in ("local", True)
    ] == ["", ""]


@pytest.mark.parametrize("endpoint", [*NETWORK])
def test_plain_traffic_on_the_network_can_be_read(endpoint):
    assert is_unencrypted(endpoint)


@pytest.mark.parametrize("endpoint", [SOCKET, SERIAL, *HERE, *ENCRYPTED])
def test_other_traffic_cannot_be_read_on_the_network(endpoint):
    assert not is_unencrypted(endpoint)


@pytest.mark.parametrize(
    ("name", "valid"),
    [
        ("desk-1.A_b", True),
        ("7", True),
        ("a" * 64, True),
        ("a" * 65, False),
        ("-a", False),
        ("../x", False),
        ("", False),
    ],
)
def test_an_identity_fits_a_certificate_and_a_file_name(name, valid):
    assert bool(COMMON_NAME.fullmatch(name)) is valid
