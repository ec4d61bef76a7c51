"""What a folder of recordings holds, and a window of it in one file."""

import stat

import pytest

from fleet.errors import StateError
from fleet.record.export import export, recorded_in
from fleet.record.messages import Message
from fleet.record.ring import Ring, files_in
from fleet.record.task import Bounds

NOW = 1_790_000_000.0


@pytest.fixture
def folder(tmp_path):
    """Record one message a second: five into each of three files, the last of which is not ended."""
    folder = tmp_path / "recordings"
    for first in (0, 5, 10):
        ring = Ring(folder, Bounds(free=0))
        file = ring.file(NOW + first)
        for number in range(first, first + 5):
            file.add(Message("/a", "fleet.Document", b'{"n": %d}' % number), int((NOW + number) * 1e9))
        file.flush()
        last = file.path.read_bytes()
        ring.close()
    file.path.write_bytes(last)
    return folder


def test_the_files_are_listed_with_when_they_were_recorded(folder):
    first, second, last = recorded_in(folder)
    assert [(first.begins, first.ends, first.messages), second.messages] == [(NOW, NOW + 4, 5), 5]
    assert (last.begins, last.messages) == (NOW + 10, None)


def test_a_window_is_exported_over_the_ends_of_files(folder, tmp_path, read_back):
    into = tmp_path / "window.mcap"
    assert export(folder, into, since=NOW + 3, until=NOW + 12) == 9
    found = [(topic, schema, each.data) for topic, schema, each in read_back(into)]
    assert found == [("/a", "fleet.Document", b'{"n": %d}' % number) for number in range(3, 12)]
    assert stat.S_IMODE(into.stat().st_mode) == 0o600


def test_a_file_that_was_cut_off_gives_what_it_has(folder, tmp_path):
    last = files_in(folder)[-1]
    last.write_bytes(last.read_bytes()[:-300])
    assert export(folder, tmp_path / "window.mcap", since=0, until=float("inf")) == 10


def test_a_time_of_which_there_is_nothing_is_refused(folder, tmp_path):
    into = tmp_path / "window.mcap"
    with pytest.raises(StateError, match="has no data of that time"):
        export(folder, into, since=NOW + 100_000_000_000, until=float("inf"))
    assert not into.exists()


def test_a_file_that_is_there_is_not_overwritten(folder, tmp_path):
    into = tmp_path / "window.mcap"
    into.write_text("mine")
    with pytest.raises(StateError, match="is there already"):
        export(folder, into, since=0, until=float("inf"))
    assert into.read_text() == "mine"


def test_a_folder_that_is_not_there_is_reported(tmp_path):
    with pytest.raises(StateError, match="nothing was recorded there"):
        recorded_in(tmp_path / "none")
