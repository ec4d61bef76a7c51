"""One page: what it may ask for, and what becomes of one that sends what cannot be read."""

import json

import pytest
from websockets.exceptions import ConnectionClosed

from fleet.console.request_guard import LONGEST_BODY
from fleet.model.permission import Permission


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
        page.request("ping", number=7)
        assert page.next("pong")["number"] == 7


def test_a_page_that_sends_nothing_but_garbage_is_closed(console):
    with console.page() as page:
        for _ in range(16):
            page.socket.send("garbage")
        with pytest.raises(ConnectionClosed) as closed:
            page.next("never")
        assert closed.value.rcvd.code == 1007


@pytest.mark.parametrize(
    ("permission", "given", "fields"),
    [
        (Permission.VIEW, "goto", {"robots": ["yard/rex"], "x": 1.0, "y": 0.0}),
        (Permission.VIEW, "release", {"robots": ["yard/rex"]}),
        (Permission.VIEW, "command", {"robot": "yard/rex", "command": "takeoff"}),
        (Permission.OPERATE, "command", {"robot": "yard/rex", "command": "restart_adapter"}),
    ],
)
def test_a_permission_that_is_too_low_moves_and_changes_nothing(console, permission, given, fields):
    with console.page(permission) as page:
        page.request(given, request="r", **fields)
        answer = page.answer("r")
        assert (answer["status"], "it needs the permission" in answer["reason"]) == ("rejected", True)


def test_everybody_with_a_session_may_stop(console):
    with console.page(Permission.VIEW) as page:
        page.request("stop", request="by-viewer")
        assert page.answer("by-viewer")["status"] == "accepted"
    status, _, _ = console.post(
        "/api/stop", {"ask": "stop", "request": "by-post"}, cookie=console.cookie(Permission.VIEW)
    )
    assert status == 200
