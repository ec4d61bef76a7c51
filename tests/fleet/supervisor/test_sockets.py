import contextlib
import socket

import pytest

from fleet.supervisor.sockets import LONGEST, connected, listening, socket_of, sockets_in


def test_a_path_too_long_for_a_socket_says_what_to_do(tmp_path):
    place = tmp_path / ("x" * 100)
    with pytest.raises(OSError, match="too long for a Unix socket; set FLEET_RUNTIME_DIR to a shorter place"):
        listening(socket_of(place, 1))


def test_the_longest_path_that_is_accepted_can_be_used(tmp_path_factory):
    folder = tmp_path_factory.mktemp("x")
    path = socket_of(folder, 1)
    longest = path.with_name(path.name.replace("1", "1" * (LONGEST - len(str(path)))))
    with contextlib.closing(listening(longest)), connected(longest, within=5.0):
        assert list(sockets_in(folder)) == [longest]


def test_a_socket_can_be_found_only_once_it_listens(tmp_path, monkeypatch):
    listen, seen = socket.socket.listen, []

    def look_first(sock):
        seen.append(list(sockets_in(tmp_path)))
        listen(sock)

    monkeypatch.setattr(socket.socket, "listen", look_first, raising=False)
    with contextlib.closing(listening(socket_of(tmp_path, 1))):
        assert (seen, list(sockets_in(tmp_path))) == ([[]], [socket_of(tmp_path, 1)])
        with connected(socket_of(tmp_path, 1), within=5.0):
            pass


def test_a_socket_of_a_dead_process_is_replaced(tmp_path):
    path = socket_of(tmp_path, 1)
    listening(path).close()
    with pytest.raises(ConnectionRefusedError):
        connected(path, within=5.0)
    with contextlib.closing(listening(path)), connected(path, within=5.0):
        assert list(tmp_path.iterdir()) == [path], "nothing else is left behind"
