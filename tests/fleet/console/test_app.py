"""The addresses of the console: sessions, and the stop that needs no WebSocket."""

import json

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from fleet.model.permission import Permission


@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/api/session"), ("GET", "/api/stops/x"), ("POST", "/api/stop")]
)
@pytest.mark.parametrize(
    "cookie", [None, "", "fleet_console_0000000000000000=x", "{name}=", "{name}=guess", "{name}={value}x"]
)
def test_nothing_is_reported_and_nothing_done_without_a_session(console, method, path, cookie):
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
    session = json.loads(body)
    assert (status, session.pop("proof") != "") == (200, True)
    assert session == {"operator": "anna", "permission": "admin"}
    name, *flags = headers["set-cookie"].split("; ")
    assert name.startswith("fleet_console_")
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(flags)
    assert console.post("/api/session", {"token": token})[0] == 403


@pytest.mark.parametrize(
    ("content", "status"),
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
def test_what_is_no_token_opens_no_session(console, content, status):
    assert console.post("/api/session", content)[0] == status


def test_a_cookie_of_another_console_is_no_good_here(runtime, serve_console, console):
    with serve_console(runtime, "other") as other:
        value = other.cookie().partition("=")[2]
        name = console.cookie().partition("=")[0]
        assert other.cookie().partition("=")[0] != name
        assert console.request("GET", "/api/session", cookie=other.cookie())[0] == 401
        assert console.request("GET", "/api/session", cookie=f"{name}={value}")[0] == 401


def test_a_cookie_that_another_port_of_the_computer_was_sent_is_worth_nothing_without_its_proof(console):
    cookie, other = console.cookie(), console.proofs[console.cookie(Permission.VIEW)]
    for proof in ("", "guess", other):
        assert console.request("GET", "/api/session", cookie=cookie, x_fleet_proof=proof)[0] == 401
    assert console.request("GET", "/api/session", cookie=cookie)[0] == 200
    for shown in (None, ["fleet.console", "guess"], ["fleet.console", other], [console.proofs[cookie]]):
        with pytest.raises(InvalidStatus) as refused:
            connect(
                f"ws://127.0.0.1:{console.port}/ws",
                origin=console.base,
                additional_headers={"Cookie": cookie},
                subprotocols=shown,
            )
        assert refused.value.response.status_code == 403
