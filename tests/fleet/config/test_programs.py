"""The console of fleet.yaml: beyond loopback only with TLS."""

import pytest
from pydantic import ValidationError

from fleet.config.programs import ConsoleConfig


@pytest.fixture
def tls(tmp_path):
    (tmp_path / "x.pem").touch()
    return {"cert": tmp_path / "x.pem", "key": tmp_path / "x.pem"}


def test_a_console_listens_on_loopback_alone_unless_configured_otherwise():
    assert ConsoleConfig().endpoint is None


@pytest.mark.parametrize(
    ("listen", "endpoint"),
    [("0.0.0.0:8443", ("0.0.0.0", 8443)), ("[::]:443", ("::", 443)), ("10.0.0.5:0", ("10.0.0.5", 0))],
)
def test_it_listens_with_tls_on_an_address_and_port(tls, listen, endpoint):
    assert ConsoleConfig(listen=listen, tls=tls).endpoint == endpoint


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"listen": "0.0.0.0:8443"}, "set tls"),
        ({"listen": "127.0.0.1:8443"}, "set tls"),
        ({"hosts": ["edge.test"]}, "it is for listen"),
        ({"listen": "edge.test:8443"}, "no address with a port"),
        ({"listen": "0.0.0.0:65536"}, "at most 65535"),
        ({"hosts": ["https://edge.test"]}, "should match pattern"),
    ],
)
def test_what_would_be_open_or_is_no_address_is_refused(fields, why):
    with pytest.raises(ValidationError, match=why):
        ConsoleConfig(**fields)
