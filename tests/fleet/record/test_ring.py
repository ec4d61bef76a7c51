"""The folder of a recording: private, of one recorder, bounded by size, age and what is free."""

import os
import stat
from typing import NamedTuple

import pytest

from fleet.errors import StateError
from fleet.record.messages import Message
from fleet.record.ring import DiskFull, Ring, files_in
from fleet.record.task import MIB, Bounds

NOW = 1_790_000_000.0
SMALL = Bounds(size=20_000, age=1000.0, file_size=5_000, file_age=100.0, free=0)


class Room(NamedTuple):
    f_bavail: int
    f_frsize: int


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "recordings"


def write(ring, now, size=12_000):
    """Write a file's worth."""
    file = ring.file(now)
    payload = b'{"n": "%s"}' % os.urandom(size // 2).hex().encode()
    file.add(Message("/a", "fleet.Document", payload), int(now * 1e9))
    file.flush()
    return file.path


def test_a_full_file_and_an_old_one_are_followed_by_the_next(folder):
    ring = Ring(folder, SMALL)
    first = write(ring, NOW, 10)
    assert write(ring, NOW + 1) == first
    second = write(ring, NOW + 2, 10)
    third = write(ring, NOW + 200)
    ring.close()
    assert files_in(folder) == [first, second, third]


def test_a_file_with_too_many_topics_is_followed_by_the_next(folder, monkeypatch):
    monkeypatch.setattr("fleet.record.ring.MOST_TOPICS", 1)
    ring = Ring(folder, SMALL)
    first = write(ring, NOW, 10)
    assert write(ring, NOW + 1, 10) != first
    ring.close()


def test_a_clock_that_was_set_back_begins_a_new_file(folder):
    ring = Ring(folder, SMALL)
    first = write(ring, NOW, 10)
    assert write(ring, NOW - 50, 10) != first
    ring.close()


def test_the_oldest_files_are_deleted_beyond_the_size(folder):
    ring = Ring(folder, SMALL)
    paths = [write(ring, NOW + number) for number in range(12)]
    ring.close()
    left = files_in(folder)
    assert left == paths[-len(left) :]
    assert sum(path.stat().st_size for path in left[:-1]) <= SMALL.size


def test_files_are_deleted_when_they_are_too_old(folder):
    ring = Ring(folder, SMALL)
    old = write(ring, NOW)
    ring.close()
    os.utime(old, (NOW, NOW))
    ring = Ring(folder, SMALL)
    newer = write(ring, NOW + 2000)
    ring.close()
    assert files_in(folder) == [newer]


def test_folder_and_files_are_for_their_user_alone(folder):
    ring = Ring(folder, SMALL)
    path = write(ring, NOW)
    ring.close()
    assert [stat.S_IMODE(each.stat().st_mode) for each in (folder, path)] == [0o700, 0o600]


def test_a_folder_that_others_can_read_is_refused(folder):
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    with pytest.raises(StateError, match="chmod 700"):
        Ring(folder, SMALL)


def test_a_folder_has_one_recorder(folder):
    ring = Ring(folder, SMALL)
    with pytest.raises(StateError, match="another recorder writes to"):
        Ring(folder, SMALL)
    ring.close()
    Ring(folder, SMALL).close()


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StateError, match="cannot record into"):
        Ring(tmp_path / "file" / "recordings", SMALL)


def test_nothing_is_written_to_a_disk_with_too_little_room(folder, monkeypatch):
    ring = Ring(folder, Bounds(free=512 * MIB))
    monkeypatch.setattr(os, "statvfs", lambda _: Room(100, MIB))
    with pytest.raises(DiskFull, match="has 100 MiB left, 512 MiB stay free"):
        ring.file(NOW)
    ring.close()
    assert files_in(folder) == []


def test_a_file_that_was_cut_off_is_mended_when_the_folder_is_used_again(folder, read_back):
    ring = Ring(folder, SMALL)
    path = write(ring, NOW)
    ring.close()
    path.write_bytes(path.read_bytes()[:3000])
    Ring(folder, SMALL).close()
    assert read_back(path) == []
