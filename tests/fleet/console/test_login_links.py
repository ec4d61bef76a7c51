"""The socket that hands out links: one console for each name, and nothing for who asks wrongly."""

import socket

import pytest

from fleet.console.login_links import ConsoleError, LinkRequest, all_links, request_link, serve_links
from fleet.console.task import link_socket
from fleet.model.permission import Permission

REQUESTED = LinkRequest("anna", Permission.VIEW)


def test_each_console_gives_a_new_link_each_time(runtime, console):
    first, second = (all_links(runtime, REQUESTED)["test"] for _ in range(2))
    assert first.startswith(f"{console.base}/#token=")
    assert first != second


def test_a_socket_is_for_its_user_alone(runtime, console):
    assert link_socket(runtime, "test").stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    "text", [b"", b"garbage\n", b'{"operator": "anna", "permission": 9}\n', b"x" * 10_000]
)
def test_who_asks_wrongly_gets_nothing(runtime, console, text):
    with socket.socket(socket.AF_UNIX) as sock:
        sock.connect(str(link_socket(runtime, "test")))
        sock.sendall(text)
        sock.shutdown(socket.SHUT_WR)
        assert sock.recv(100) == b""


def test_a_dead_socket_gives_no_link_and_is_replaced(runtime):
    path = link_socket(runtime, "dead")
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    assert request_link(path, REQUESTED) is None


async def test_a_second_console_of_one_name_is_refused(runtime, console):
    with pytest.raises(ConsoleError, match="console-test runs already"):
        await serve_links(link_socket(runtime, "test"), lambda _: "")
