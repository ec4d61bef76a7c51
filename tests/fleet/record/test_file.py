"""A file of a recording: whole after each flush, with an index at its end, mended after a cut."""

import os
import stat

import pytest
from mcap.reader import make_reader

from fleet.record.file import END, PARTIAL, RecordingFile, repair
from fleet.record.messages import Message


@pytest.fixture
def file(tmp_path):
    return RecordingFile(tmp_path / "one.mcap")


def fill(file, first, last):
    """Add messages with these numbers."""
    for number in range(first, last):
        file.add(Message("/a", "fleet.Document", b'{"n": %d}' % number), number * 1_000_000)


def test_what_was_flushed_can_be_read_while_the_file_is_written(file, read_back):
    assert read_back(file.path) == []
    for last in (3, 7):
        fill(file, len(read_back(file.path)), last)
        file.flush()
        assert [each.data for _, _, each in read_back(file.path)] == [b'{"n": %d}' % n for n in range(last)]
    file.close()


def test_a_closed_file_has_an_index(file):
    fill(file, 0, 5)
    file.close()
    with file.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert (summary.statistics.message_count, len(summary.chunk_indexes)) == (5, 1)


@pytest.mark.parametrize("stamp", [-1.0, 1e300, float("inf"), float("nan")])
def test_a_stamp_that_is_no_time_is_replaced_by_when_it_came(file, read_back, stamp):
    file.add(Message("/a", "fleet.Document", b"{}", stamp), 7)
    file.close()
    ((_, _, message),) = read_back(file.path)
    assert (message.log_time, message.publish_time) == (7, 7)


def test_only_its_user_can_read_it(file):
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o600


def test_chunks_are_small_and_compressed(file):
    for number in range(40):
        file.add(Message("/a", "fleet.Document", b'{"n": "%s"}' % (b"x" * 30_000)), number)
    file.close()
    with file.path.open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert max(chunk.uncompressed_size for chunk in chunks) < 300_000


def test_a_file_cut_anywhere_behind_its_head_can_be_read_after_its_repair(file, read_back):
    for last in range(10, 60, 10):
        fill(file, last - 10, last)
        file.flush()
    file.close()
    whole, cut = file.path.read_bytes(), file.path.with_name("cut.mcap")
    for size in range(200, len(whole) - len(END), 37):
        cut.write_bytes(whole[:size])
        assert repair(cut)
        assert [each.log_time for _, _, each in read_back(cut)] in [
            [number * 1_000_000 for number in range(last)] for last in range(0, 60, 10)
        ]


def test_a_whole_file_and_a_foreign_one_are_left_as_they_are(file, tmp_path):
    fill(file, 0, 5)
    file.close()
    foreign = tmp_path / "foreign.mcap"
    foreign.write_bytes(b"no MCAP at all")
    before = file.path.read_bytes()
    assert (repair(file.path), repair(foreign)) == (False, False)
    assert (file.path.read_bytes(), foreign.read_bytes()) == (before, b"no MCAP at all")


def fail(*_):
    raise OSError(28, "No space left on device")


def test_a_file_has_its_header_from_the_moment_it_can_be_found(tmp_path, read_back, monkeypatch):
    found, pwrite = [], os.pwrite

    def looked_for(*arguments):
        found.append(list(tmp_path.glob("*.mcap")))
        return pwrite(*arguments)

    monkeypatch.setattr(os, "pwrite", looked_for)
    (tmp_path / PARTIAL).write_bytes(b"left by a recorder that was killed")
    file = RecordingFile(tmp_path / "one.mcap")
    assert (found, read_back(tmp_path / "one.mcap")) == ([[]], [])
    assert list(tmp_path.iterdir()) == [file.path]
    file.close()


def test_a_disk_that_fails_at_the_header_leaves_neither_file_nor_descriptor(tmp_path, monkeypatch):
    descriptors = []

    def fail_at_once(descriptor, *_):
        descriptors.append(descriptor)
        fail()

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", fail_at_once)
        with pytest.raises(OSError, match="No space left"):
            RecordingFile(tmp_path / "one.mcap")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(*descriptors)


def test_a_disk_that_fails_is_reported_and_leaves_what_was_flushed(file, read_back, monkeypatch):
    fill(file, 0, 5)
    file.flush()
    fill(file, 5, 9)
    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", fail)
        with pytest.raises(OSError, match="No space left"):
            file.flush()
    file.close()
    assert file.failed
    assert len(read_back(file.path)) == 5
