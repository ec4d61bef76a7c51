"""Other edges: partners, and the lease service of a pair."""

import pytest
from pydantic import ValidationError

from fleet.config.other_edges import LeaseConfig, PartnerConfig, check_server, host_of, port_of

PLAIN, TLS, HERE = "nats://10.0.0.3:4222", "tls://lease.local:4222", "nats://localhost:4222"


@pytest.mark.parametrize(
    ("server", "host", "port"),
    [
        (PLAIN, "10.0.0.3", 4222),
        (TLS, "lease.local", 4222),
        ("nats://[2001:db8::1]:1", "[2001:db8::1]", 1),
        ("tls://a_b-c.d:65535", "a_b-c.d", 65535),
    ],
)
def test_a_server_has_a_host_and_a_port(server, host, port):
    assert (check_server(server), host_of(server), port_of(server)) == (server, host, port)


@pytest.mark.parametrize(
    "server",
    [
        "",
        "10.0.0.3:4222",
        "http://h:4222",
        "nats://h",
        "nats://h:",
        "nats://:4222",
        "nats://h:123456",
        "nats://h:0",
        "nats://h:65536",
        "nats://h:42/x",
        "nats://u:p@h:42",
        "NATS://h:42",
        "nats://h:42\n",
    ],
)
def test_what_is_no_server_is_refused_with_how_to_write_one(server):
    with pytest.raises(ValueError, match=r"is no server; write nats://HOST:4222, or tls://HOST:4222"):
        check_server(server)


def test_what_is_no_server_has_no_host_and_no_port():
    assert (host_of("10.0.0.3:4222"), port_of("10.0.0.3:4222")) == ("", 0)


@pytest.mark.parametrize("servers", [(TLS,), (HERE,), ("nats://127.0.0.1:1", "nats://[::1]:1"), (TLS, HERE)])
def test_an_encrypted_service_or_one_on_this_computer_is_taken(servers):
    assert LeaseConfig(servers=servers).servers == servers


@pytest.mark.parametrize("servers", [(PLAIN,), (TLS, PLAIN), (HERE, "nats://lease.local:1")])
def test_a_plain_service_elsewhere_is_taken_only_when_it_is_said(servers):
    with pytest.raises(
        ValidationError, match="is not encrypted: write tls://, or set insecure: true"
    ) as caught:
        LeaseConfig(servers=servers)
    assert caught.value.errors()[0]["ctx"]["key"] == "servers"
    assert servers[-1] in str(caught.value)
    assert LeaseConfig(servers=servers, insecure=True).servers == servers


@pytest.mark.parametrize(("given", "key"), [({"user": "u"}, "user"), ({"password": "p"}, "password")])
def test_user_and_password_come_together(given, key):
    with pytest.raises(ValidationError, match="user and password come together") as caught:
        LeaseConfig(servers=(TLS,), **given)
    assert caught.value.errors()[0]["ctx"]["key"] == key
    assert LeaseConfig(servers=(TLS,), user="u", password="p").password.get_secret_value() == "p"


@pytest.mark.parametrize("given", [{"servers": ()}, {"servers": ("x",)}, {"servers": (TLS,), "user": ""}])
def test_a_lease_needs_a_server_and_no_empty_user(given):
    with pytest.raises(ValidationError):
        LeaseConfig(**given)


def test_the_certificates_to_trust_exist(tmp_path):
    with pytest.raises(ValidationError, match="there is no"):
        LeaseConfig(servers=(TLS,), ca_file=tmp_path / "none.pem")


def test_a_partner_that_says_nothing_shares_and_coordinates_nothing():
    assert PartnerConfig() == PartnerConfig(robots=(), coordinates=False)
    with pytest.raises(ValidationError):
        PartnerConfig(robots=("Max",))
