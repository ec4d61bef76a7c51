"""The security of the console, one line for each attempt: who is refused, and that who belongs is not."""

import socket

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from fleet.console.request_guard import HOSTS, LONGEST_BODY, POLICY

OTHER = "http://evil.example"


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:{port}",
        "127.0.0.1.evil.example:{port}",
        "127.0.0.1:{port}@evil.example",
        "localhost.:{port}",
        "0.0.0.0:{port}",
        "10.0.0.5:{port}",
        "[::2]:{port}",
        "127.0.0.1:port",
        "127.0.0.1:{port}/..",
        "",
    ],
)
def test_another_name_of_this_computer_is_refused(console, host):
    status, _, body = console.request("GET", "/", host=host.format(port=console.port))
    assert (status, b"127.0.0.1 or localhost" in body) == (403, True)


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:9000", "[::1]:{port}"])
def test_the_names_of_this_computer_pass_also_through_a_tunnel(console, host):
    assert console.request("GET", "/", host=host.format(port=console.port))[0] == 200


def test_a_request_with_two_hosts_or_none_is_refused(console):
    two = "GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\nConnection: close\r\n\r\n"
    assert " 40" in console.raw(two)
    assert " 40" in console.raw("GET / HTTP/1.1\r\nConnection: close\r\n\r\n")
    assert " 40" in console.raw("GET / HTTP/1.0\r\n\r\n")


POSTS = [
    {"origin": OTHER},
    {"origin": "null"},
    {"origin": None},
    {"origin": "https://127.0.0.1:{port}"},
    {"origin": "http://localhost:{port}"},
    {"origin": "http://127.0.0.1:1"},
    {"sec_fetch_site": "cross-site"},
    {"sec_fetch_site": "same-site"},
    {"content_type": "text/plain"},
    {"content_type": "application/x-www-form-urlencoded"},
    {"content_type": "application/json; charset=utf-8"},
    {"content_length": None},
    {"content_length": str(LONGEST_BODY + 1)},
    {"content_length": "-1"},
]


@pytest.mark.parametrize(
    "changed", POSTS, ids=lambda changed: "-".join(f"{k}-{v}" for k, v in changed.items())
)
def test_a_stop_from_a_foreign_page_or_in_a_foreign_form_is_refused(console, changed):
    headers = {name: value and value.format(port=console.port) for name, value in changed.items()}
    content = {"ask": "stop", "request": "x"}
    status, _, _ = console.post("/api/stop", content, cookie=console.cookie(), **headers)
    assert status in {400, 403}


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT"])
def test_other_methods_are_refused(console, method):
    assert console.request(method, "/api/stop", origin=console.base)[0] in {400, 403}


@pytest.mark.parametrize("path", ["/", "/stop.js", "/nothing", "/api/session"])
def test_each_answer_has_the_policy_that_keeps_foreign_code_and_frames_out(console, path):
    _, headers, _ = console.request("GET", path)
    assert headers["content-security-policy"] == POLICY
    assert "unsafe" not in POLICY
    assert "default-src 'none'" in POLICY
    assert "frame-ancestors 'none'" in POLICY
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert headers["server"] is None


def test_a_refusal_has_the_policy_too_and_says_why(console):
    _, headers, body = console.post("/api/stop", {}, origin=OTHER)
    assert headers["content-security-policy"] == POLICY
    assert b"another origin" in body


def test_an_address_that_is_too_long_and_a_header_that_never_ends_are_refused(console):
    assert console.request("GET", "/" + "a" * 2000)[0] == 403
    assert " 200 " not in console.raw(f"GET / HTTP/1.1\r\nHost: localhost\r\nX: {'a' * 200_000}")


def proof_of(console):
    """Return what shows the proof of a session when a WebSocket is opened."""
    return ["fleet.console", console.proofs[console.cookie()]]


def test_a_websocket_of_a_page_of_the_console_with_a_session_is_opened(console):
    with console.page() as page:
        assert page.socket.subprotocol == "fleet.console"


SOCKETS = [
    {"origin": OTHER},
    {"origin": None},
    {"origin": "null"},
    {"Sec-Fetch-Site": "cross-site"},
    {"Cookie": ""},
    {"Cookie": "fleet_console_x=guess"},
]


@pytest.mark.parametrize("changed", SOCKETS, ids=str)
def test_a_websocket_of_a_foreign_page_or_without_a_session_is_not_opened(console, changed):
    headers = {"Cookie": console.cookie()} | {k: v for k, v in changed.items() if k != "origin"}
    origin, shown = changed.get("origin", console.base), proof_of(console)
    address = f"ws://127.0.0.1:{console.port}/ws"
    with pytest.raises(InvalidStatus) as refused:
        connect(address, origin=origin, additional_headers=headers, subprotocols=shown)
    assert refused.value.response.status_code == 403


def test_a_websocket_by_a_name_that_resolves_to_this_computer_is_not_opened(console):
    with (
        socket.create_connection(("127.0.0.1", console.port)) as sock,
        pytest.raises(InvalidStatus) as refused,
    ):
        connect(
            "ws://evil.example/ws", sock=sock, origin=OTHER, additional_headers={"Cookie": console.cookie()}
        )
    assert refused.value.response.status_code == 403


def test_only_loopback_is_listened_on(console):
    assert {"127.0.0.1", "localhost", "[::1]"} == HOSTS
    assert console.base.startswith("http://127.0.0.1:")
