"""The socket of a supervisor whose file is removed while it runs."""

import itertools
import os
import selectors
import shutil
import socket
import tempfile
from pathlib import Path

import pytest

from fleet.supervisor.listener import CHECK_EVERY, SupervisorListener
from fleet.supervisor.sockets import connected, socket_of


class Place:
    """A listener with a second place, and its connections."""

    def __init__(self, folder):
        self.usual, self.other = (socket_of(folder / name, os.getpid()) for name in ("run", "other"))
        self.usual.parent.mkdir()
        self.lines, self.connections = [], 0
        self.selector = selectors.DefaultSelector()
        self.listener = SupervisorListener(
            [self.usual, self.other], self.selector, accept=self._accept, report=self.lines.append
        )
        self._times = itertools.count(0.0, CHECK_EVERY)

    def _accept(self, listener):
        listener.accept()[0].close()
        self.connections += 1

    def check(self):
        self.listener.check(next(self._times))

    def accepts_at(self, path):
        """Return whether a connection to a path reaches the listener."""
        before = self.connections
        with connected(path, within=1.0):
            for key, _ in self.selector.select(0):
                key.data()
        return self.connections == before + 1


@pytest.fixture
def place():
    with tempfile.TemporaryDirectory() as folder:  # short: the path of a socket must be
        place = Place(Path(folder))
        with place.selector, place.listener:
            yield place


def test_it_listens_at_the_first_place_and_leaves_nothing_there():
    with tempfile.TemporaryDirectory() as folder:
        place = Place(Path(folder))
        with place.selector, place.listener:
            place.check()
            assert place.accepts_at(place.usual)
        assert not place.usual.exists()
        assert place.lines == []


def test_it_listens_again_where_its_folder_was_removed(place):
    shutil.rmtree(place.usual.parent)
    place.check()
    assert place.accepts_at(place.usual)
    assert place.usual.parent.stat().st_mode & 0o777 == 0o700
    (line,) = place.lines
    assert f"{place.usual} was removed, as at a logout" in line


def test_it_listens_at_the_other_place_when_its_folder_cannot_be_made_again(place):
    shutil.rmtree(place.usual.parent)
    place.usual.parent.write_text("not a folder")
    place.check()
    assert place.accepts_at(place.other)
    assert place.listener.path == place.other
    assert f"fleet stop reaches the supervisor at {place.other}" in place.lines[0]


def test_it_says_once_that_it_can_listen_nowhere_and_tries_on(place):
    shutil.rmtree(place.usual.parent)
    for path in (place.usual, place.other):
        path.parent.write_text("not a folder")
    place.check()
    place.check()
    (line,) = place.lines
    assert "fleet stop cannot reach the supervisor here" in line
    place.usual.parent.unlink()
    place.check()
    assert place.accepts_at(place.usual)


def test_the_socket_of_another_program_in_its_place_is_replaced(place):
    place.usual.unlink()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other:
        other.bind(str(place.usual))
        place.check()
        assert place.accepts_at(place.usual)


def test_it_looks_for_its_file_no_more_often_than_needed(place):
    place.listener.check(0.0)
    place.usual.unlink()
    place.listener.check(CHECK_EVERY / 2)
    assert place.lines == []
