"""Which connections to the broker are opened, and what is said when one cannot be."""

import asyncio
import socket
import ssl

import pytest

from fleet.cloud import endpoint
from fleet.cloud.endpoint import open_socket, tls_context
from fleet.cloud.mqtt_session import SessionRefused
from fleet.cloud.values import CloudSettings
from fleet.errors import CloudError


def settings(host="mqtt.example.com", **more):
    return CloudSettings(host=host, client_id="fleet_us", **more)


def raises(error):
    async def fail(*_):
        raise error

    return fail


def opening(monkeypatch, *, dialled=None, secured=None):
    """Return what is said of a connection whose dialling or handshake fails."""

    async def connected(*_):
        return "socket"

    monkeypatch.setattr(endpoint, "dial", raises(dialled) if dialled else connected)
    monkeypatch.setattr(endpoint, "wrap_tls", raises(secured) if secured else connected)
    with pytest.raises((CloudError, SessionRefused)) as caught:
        asyncio.run(open_socket(settings(port=8884), tls_context(settings())))
    return caught.value


# -- whether it is safe -------------------------------------------------------------------------------


def test_a_broker_is_verified_by_its_name_and_certificate():
    context = tls_context(settings())
    assert (context.check_hostname, context.verify_mode) == (True, ssl.CERT_REQUIRED)


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "127.1.2.3", "::1"])
def test_a_plain_connection_to_this_computer_is_opened(host):
    assert tls_context(settings(host, tls=False)) is None


@pytest.mark.parametrize(
    "host", ["mqtt.example.com", "10.0.0.1", "0.0.0.0", "localhost.example.com", "LOCALHOST", ""]
)
def test_a_plain_connection_to_another_computer_is_opened_only_when_it_is_said(host):
    with pytest.raises(CloudError) as caught:
        tls_context(settings(host, tls=False))
    assert str(caught.value) == (
        f"the connection to {host} would be in clear text, with the token in it; "
        "set tls: true, or insecure: true if you accept that"
    )
    assert tls_context(settings(host, tls=False, insecure=True)) is None


def test_insecure_does_not_weaken_tls():
    assert tls_context(settings(insecure=True)).verify_mode is ssl.CERT_REQUIRED


@pytest.mark.parametrize("content", [None, "rubbish"])
def test_a_certificate_file_that_cannot_be_used_is_named(tmp_path, content):
    path = tmp_path / "ca.pem"
    if content:
        path.write_text(content)
    with pytest.raises(CloudError, match=f"the certificate file {path} cannot be used: "):
        tls_context(settings(ca_file=str(path)))


# -- why it cannot be opened --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            socket.gaierror(-2, "Name or service not known"),
            "the name mqtt.example.com cannot be looked up: Name or service not known",
        ),
        (
            ConnectionRefusedError(111, "Connection refused"),
            "mqtt.example.com:8884 cannot be reached: Connection refused",
        ),
        (OSError("all addresses failed"), "mqtt.example.com:8884 cannot be reached: all addresses failed"),
    ],
)
def test_a_broker_that_cannot_be_reached_is_named_with_the_reason(monkeypatch, error, said):
    found = opening(monkeypatch, dialled=error)
    assert type(found) is CloudError
    assert str(found) == said


def unverified(code, message):
    error = ssl.SSLCertVerificationError(1, "failed")
    error.verify_code, error.verify_message = code, message
    return error


@pytest.mark.parametrize(
    ("code", "cure"),
    [
        *((code, "name it in cloud.host as the certificate does") for code in (62, 63, 64)),
        *((code, "set ca_file if it is your own") for code in (10, 18, 20)),
    ],
)
def test_a_certificate_that_is_not_trusted_is_no_matter_of_haste(monkeypatch, code, cure):
    found = opening(monkeypatch, secured=unverified(code, "it is wrong."))
    assert type(found) is SessionRefused
    assert str(found) == f"the certificate of mqtt.example.com:8884 is not trusted: it is wrong; {cure}"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ConnectionResetError(104, "Connection reset by peer"),
            "does not finish the TLS handshake: Connection reset by peer",
        ),
        (ConnectionAbortedError("cut"), "does not finish the TLS handshake: cut"),
        (OSError(), "does not finish the TLS handshake: the connection was ended"),
    ],
)
def test_a_handshake_that_ends_early_asks_for_the_port(monkeypatch, error, said):
    found = opening(monkeypatch, secured=error)
    assert type(found) is CloudError
    assert (
        str(found) == f"mqtt.example.com:8884 {said}; is it the port for TLS? (a plain one wants tls: false)"
    )


def test_a_broker_that_speaks_something_else_asks_for_the_port(monkeypatch):
    error = ssl.SSLError(1, "[SSL: WRONG_VERSION_NUMBER] wrong version number")
    error.reason = "WRONG_VERSION_NUMBER"
    found = opening(monkeypatch, secured=error)
    assert type(found) is CloudError
    assert str(found).startswith(
        "mqtt.example.com:8884 does not speak TLS as expected: WRONG_VERSION_NUMBER; "
    )
    assert str(found).endswith("is it the port for TLS? (a plain one wants tls: false)")


@pytest.mark.parametrize(("tls", "opened"), [(True, "secured"), (False, "plain")])
def test_a_connection_is_secured_only_with_tls(monkeypatch, tls, opened):
    calls = []

    async def dial(host, port):
        calls.append((host, port))
        return "plain"

    async def secure(plain, context, host):
        calls.append((plain, host))
        return "secured"

    monkeypatch.setattr(endpoint, "dial", dial)
    monkeypatch.setattr(endpoint, "wrap_tls", secure)
    wanted = settings("localhost", tls=tls, port=1)
    assert asyncio.run(open_socket(wanted, tls_context(wanted))) == opened
    assert calls == [("localhost", 1), ("plain", "localhost")][: 1 + tls]
