"""A window of recordings: one robot's messages, spread over the window, and what of it cannot be read."""

import errno
import itertools
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.record.chunks import Chunks
from fleet.record.recorded_folder import MOST_IN_WINDOW, RecordedFolder
from fleet.record.window import Window, spread
from tests.tools.recordings import write_recording

BEGINS = 1_795_000_000.0
SECONDS = 30


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a recording that is still written."""
    ring = write_recording(tmp_path / "recordings", BEGINS, SECONDS, ends=False)
    yield tmp_path / "recordings"
    ring.close()


def window_of(folder, since, until, *, prefix="/yard-1/rex/"):
    window = Window(prefix, BEGINS + since, BEGINS + until)
    RecordedFolder(folder).find(window)
    return window


def positions(window, parts=None):
    """Return when positions were received, in seconds of the recording."""
    found = [
        message
        for part in (window.parts if parts is None else parts)
        for message in window.read(part, lambda channel: channel.topic.endswith("/position"))
    ]
    assert {message.topic for message in found} <= {"/yard-1/rex/position"}
    return [message.received - BEGINS for message in found]


def damage(window, number):
    """Change a byte of a part of a window, by its number in time."""
    part = sorted(window.parts, key=lambda part: part.chunk.begins)[number]
    content = bytearray(part.chunks.path.read_bytes())
    content[part.chunk.at + part.chunk.size // 2] ^= 0xFF
    part.chunks.path.write_bytes(content)


def test_a_window_has_the_messages_of_its_robot_and_its_time(folder):
    window = window_of(folder, 4.0, 8.25)
    assert sorted(positions(window)) == [4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0]
    assert window.all_problems() == []


def test_its_first_parts_are_spread_over_it(folder):
    window = window_of(folder, 0.0, 30.0)
    assert sorted(positions(window, window.parts[:5])) == pytest.approx([0, 4, 8, 16, 24], abs=4)


@pytest.mark.parametrize("bounds", [(-60.0, -1.0), (40.0, 50.0)])
def test_a_window_of_another_time_is_empty_and_so_is_that_of_an_unknown_robot(folder, bounds):
    assert window_of(folder, *bounds).parts == []
    assert window_of(folder, 0.0, 30.0, prefix="/yard-1/nobody/").parts == []


def test_a_file_that_is_cut_off_is_reported_with_the_time_if_the_window_goes_beyond(folder):
    (path,) = folder.glob("*.mcap")
    path.write_bytes(path.read_bytes()[:-2000])
    (problem,) = window_of(folder, 10.0, 30.0).all_problems()
    assert path.name in problem
    assert "UTC can be read" in problem
    assert window_of(folder, 1.0, 5.0).all_problems() == []


def test_a_damaged_part_is_reported_once_it_was_to_be_read(folder):
    (path,) = folder.glob("*.mcap")
    window = window_of(folder, 0.0, 30.0)
    damage(window, 20)
    assert len(positions(window)) == 2 * SECONDS - 1
    assert window.all_problems() == [f"{path.name} is damaged: 1 of its parts cannot be read"]


def test_topics_whose_names_are_lost_are_reported(folder):
    (path,) = folder.glob("*.mcap")
    damage(window_of(folder, 0.0, 30.0), 0)
    problems = window_of(folder, 5.0, 9.0).all_problems()
    assert f"{path.name} is damaged: some topics of it cannot be read" in problems


def test_a_file_that_may_not_be_read_is_reported(folder, monkeypatch):
    (path,) = folder.glob("*.mcap")
    monkeypatch.setattr(
        Chunks, "refresh", Mock(side_effect=PermissionError(errno.EACCES, "Permission denied"))
    )
    window = window_of(folder, 0.0, 30.0)
    assert (window.parts, window.all_problems()) == ([], [f"{path.name} cannot be read: Permission denied"])


def test_a_file_that_is_deleted_meanwhile_is_reported(folder):
    (path,) = folder.glob("*.mcap")
    window = window_of(folder, 0.0, 30.0)
    path.unlink()
    assert positions(window, window.parts[:2]) == []
    assert window.all_problems() == [f"{path.name} cannot be read: No such file or directory"]


def test_of_many_files_the_newest_are_read_and_the_others_are_reported(tmp_path):
    for number in range(MOST_IN_WINDOW + 2):
        write_recording(tmp_path, BEGINS + 10 * number, 5)
    window = window_of(tmp_path, 0.0, 100.0)
    assert len(positions(window)) == 10 * MOST_IN_WINDOW
    assert window.all_problems() == ["only the newest 4 of 6 files of that time are read"]


@given(st.integers(0, 300))
def test_any_number_of_first_ones_is_spread_evenly(count):
    order = spread(range(count))
    assert sorted(order) == list(range(count))
    for first in range(2, count):
        taken = sorted(order[:first])
        widest = max(later - earlier for earlier, later in itertools.pairwise(taken))
        assert max(widest, taken[0] + 1, count - taken[-1]) <= 4 * count / first + 1
