"""The security of the console, one line for each attempt: who is refused, and that who belongs is not."""

import json
import socket

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from fleet.console.guard import HOSTS, LONGEST_BODY, POLICY
from fleet.console.sessions import Permission

OTHER = "http://evil.example"
ESCAPES = (
    "/../pyproject.toml",
    "/static/../../app.py",
    "/%2e%2e/%2e%2e/etc/passwd",
    "/..%2f..%2fetc/passwd",
    "/....//....//etc/passwd",
    "/%252e%252e/etc/passwd",
    "//etc/passwd",
    "/index.html%00.js",
    "/stop.js/../app.py",
    "/app.py",
    "/__init__.py",
    "/.git/config",
)


@pytest.mark.parametrize("path", ESCAPES)
def test_no_path_leads_out_of_the_page(console, path):
    status, _, body = console.request("GET", path)
    assert (status, body) == (404, b"there is nothing here\n")


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
    told = {"ask": "stop", "request": "x"}
    status, _, _ = console.post("/api/stop", told, cookie=console.cookie(), **headers)
    assert status in {400, 403}


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT"])
def test_other_methods_are_refused(console, method):
    assert console.request(method, "/api/stop", origin=console.base)[0] in {400, 403}


@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/api/session"), ("GET", "/api/stops/x"), ("POST", "/api/stop")]
)
@pytest.mark.parametrize(
    "cookie", [None, "", "fleet_console_0000000000000000=x", "{name}=", "{name}=guess", "{name}={value}x"]
)
def test_nothing_is_told_and_nothing_done_without_a_session(console, method, path, cookie):
    name, _, value = console.cookie().partition("=")
    given = cookie and cookie.format(name=name, value=value)
    if method == "GET":
        status, _, body = console.request("GET", path, cookie=given)
    else:
        status, _, body = console.post(path, {"ask": "stop", "request": "x"}, cookie=given)
    assert (status, b"fleet console --link" in body) == (401, True)


def test_a_link_is_good_once_and_its_cookie_is_out_of_reach_of_scripts_and_other_sites(console):
    token = console.token()
    status, headers, body = console.post("/api/session", {"token": token})
    assert (status, json.loads(body)) == (200, {"operator": "anna", "permission": "admin"})
    name, *flags = headers["set-cookie"].split("; ")
    assert name.startswith("fleet_console_")
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(flags)
    assert console.post("/api/session", {"token": token})[0] == 403


@pytest.mark.parametrize(
    ("told", "status"),
    [
        ({"token": "guess"}, 403),
        ({"token": ""}, 403),
        ({"token": 5}, 400),
        ({"token": "x", "more": 1}, 400),
        ({}, 400),
        (b"garbage", 400),
        (b"", 400),
        (b"[" * 10_000, 400),
    ],
)
def test_what_is_no_token_opens_no_session(console, told, status):
    assert console.post("/api/session", told)[0] == status


def test_a_cookie_of_another_console_is_no_good_here(runtime, serve_console, console):
    with serve_console(runtime, "other") as other:
        value = other.cookie().partition("=")[2]
        name = console.cookie().partition("=")[0]
        assert other.cookie().partition("=")[0] != name
        assert console.request("GET", "/api/session", cookie=other.cookie())[0] == 401
        assert console.request("GET", "/api/session", cookie=f"{name}={value}")[0] == 401


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


SOCKETS = [
    ({"origin": OTHER}, 403),
    ({"origin": None}, 403),
    ({"origin": "null"}, 403),
    ({"Sec-Fetch-Site": "cross-site"}, 403),
    ({"Cookie": ""}, 401),
    ({"Cookie": "fleet_console_x=guess"}, 401),
]


@pytest.mark.parametrize(("changed", "status"), SOCKETS, ids=str)
def test_a_websocket_of_a_foreign_page_or_without_a_session_is_not_opened(console, changed, status):
    headers = {"Cookie": console.cookie()} | {k: v for k, v in changed.items() if k != "origin"}
    origin = changed.get("origin", console.base)
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{console.port}/ws", origin=origin, additional_headers=headers)
    assert refused.value.response.status_code == status


def test_a_websocket_by_a_name_that_resolves_to_this_computer_is_not_opened(console):
    with (
        socket.create_connection(("127.0.0.1", console.port)) as sock,
        pytest.raises(InvalidStatus) as refused,
    ):
        connect(
            "ws://evil.example/ws", sock=sock, origin=OTHER, additional_headers={"Cookie": console.cookie()}
        )
    assert refused.value.response.status_code == 403


def test_a_message_that_is_too_large_closes_the_page(console):
    with console.page() as page:
        page.socket.send("x" * (LONGEST_BODY + 1))
        with pytest.raises(ConnectionClosed) as closed:
            page.next("never")
        assert closed.value.rcvd.code == 1009


BAD = [
    "garbage",
    "[]",
    '{"ask": "dance"}',
    '{"ask": "stop"}',
    '{"ask": "stop", "request": "x", "robots": "all"}',
    '{"ask": "goto", "request": "x", "robots": [], "x": NaN, "y": 0}',
    '{"ask": "goto", "request": "x", "robots": ["a/b"], "x": "1", "y": 0}',
    '{"ask": "goto", "request": "x", "robots": ["a/b"], "x": 1, "y": 0, "operator": "boss"}',
    '{"ask": "command", "request": "x", "robot": "%s", "command": "stop"}' % ("a" * 201),
    json.dumps({"ask": "stop", "request": "x", "robots": ["a"] * 1001}),
    "[" * 10_000,
]


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_a_message_that_cannot_be_read_is_refused_and_the_page_stays(console, text):
    with console.page() as page:
        page.socket.send(text)
        assert page.next("answer")["reason"].startswith("it cannot be read")
        page.ask("ping", number=7)
        assert page.next("pong")["number"] == 7


def test_a_page_that_sends_nothing_but_garbage_is_closed(console):
    with console.page() as page:
        for _ in range(16):
            page.socket.send("garbage")
        with pytest.raises(ConnectionClosed) as closed:
            page.next("never")
        assert closed.value.rcvd.code == 1007


@pytest.mark.parametrize(
    ("permission", "ask", "fields"),
    [
        (Permission.VIEW, "goto", {"robots": ["yard/rex"], "x": 1.0, "y": 0.0}),
        (Permission.VIEW, "release", {"robots": ["yard/rex"]}),
        (Permission.VIEW, "command", {"robot": "yard/rex", "command": "takeoff"}),
        (Permission.OPERATE, "command", {"robot": "yard/rex", "command": "restart_adapter"}),
    ],
)
def test_a_permission_that_is_too_low_moves_and_changes_nothing(console, permission, ask, fields):
    with console.page(permission) as page:
        page.ask(ask, request="r", **fields)
        answer = page.answer("r")
        assert (answer["status"], "it needs the permission" in answer["reason"]) == ("rejected", True)


def test_everybody_with_a_session_may_stop(console):
    with console.page(Permission.VIEW) as page:
        page.ask("stop", request="by-viewer")
        assert page.answer("by-viewer")["status"] == "accepted"
    status, _, _ = console.post(
        "/api/stop", {"ask": "stop", "request": "by-post"}, cookie=console.cookie(Permission.VIEW)
    )
    assert status == 200


def test_only_loopback_is_listened_on(console):
    assert {"127.0.0.1", "localhost", "[::1]"} == HOSTS
    assert console.base.startswith("http://127.0.0.1:")
