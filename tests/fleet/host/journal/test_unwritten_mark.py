"""The mark that a stop may be missing in the database: set and removed by its owner, never raising."""

import os
from pathlib import Path

from fleet.host.journal import unwritten_mark
from fleet.host.journal.unwritten_mark import UnwrittenMark, remove
from fleet.spool.state_folder import JOURNAL

FILES = Path("/proc/self/fd")


def mark_of(folder, name):
    return folder / f"{JOURNAL}.unwritten-{name}"


def marks_in(folder):
    return sorted(path.name.rpartition("-")[2] for path in folder.iterdir())


def test_a_mark_stands_while_a_stop_is_unwritten(tmp_path):
    mark = UnwrittenMark(tmp_path, "one")
    mark.put(unwritten=False)
    assert marks_in(tmp_path) == []
    for _ in range(2):
        mark.put(unwritten=True)
        assert marks_in(tmp_path) == ["one"]
    for _ in range(2):
        mark.put(unwritten=False)
        assert marks_in(tmp_path) == []
    mark.put(unwritten=True)
    assert marks_in(tmp_path) == ["one"]


def test_only_its_owner_may_read_it(tmp_path):
    UnwrittenMark(tmp_path, "one").put(unwritten=True)
    assert mark_of(tmp_path, "one").stat().st_mode & 0o777 == 0o600


def test_it_is_on_the_medium_before_anybody_relies_on_it(tmp_path, monkeypatch):
    synchronised = []
    monkeypatch.setattr(os, "fsync", lambda file: synchronised.append((FILES / str(file)).readlink()))
    before = len(list(FILES.iterdir()))
    UnwrittenMark(tmp_path, "one").put(unwritten=True)
    assert synchronised == [tmp_path]
    assert len(list(FILES.iterdir())) == before, "nothing stays open"


def test_the_marks_of_others_are_those_of_other_processes_and_of_earlier_ones(tmp_path):
    for name in ("old", "one"):
        mark_of(tmp_path, name).touch()
    (tmp_path / JOURNAL).touch()
    (tmp_path / f"{JOURNAL}-wal").touch()
    mark = UnwrittenMark(tmp_path, "one")
    assert mark.others == [mark_of(tmp_path, "old"), mark_of(tmp_path, "one")]
    remove(mark.others)
    mark.put(unwritten=True)
    mark_of(tmp_path, "two").touch()
    assert mark.others == [mark_of(tmp_path, "two")]


def test_a_mark_of_an_earlier_process_of_its_name_is_not_taken_for_its_own(tmp_path):
    mark_of(tmp_path, "one").touch()
    mark = UnwrittenMark(tmp_path, "one")
    mark.put(unwritten=True)
    assert mark.others == [mark_of(tmp_path, "one")]
    mark.put(unwritten=False)
    assert marks_in(tmp_path) == ["one"], "whose stop may still be missing"


def test_removed_marks_are_gone_and_one_that_is_gone_already_is_no_error(tmp_path):
    mark_of(tmp_path, "two").touch()
    remove([mark_of(tmp_path, "one"), mark_of(tmp_path, "two")])
    assert marks_in(tmp_path) == []


def test_a_mark_that_cannot_be_removed_keeps_no_other(tmp_path):
    mark_of(tmp_path, "one").mkdir()
    mark_of(tmp_path, "two").touch()
    remove([mark_of(tmp_path, "one"), mark_of(tmp_path, "two")])
    assert marks_in(tmp_path) == ["one"]


def test_a_folder_that_is_not_there_is_no_error_and_the_mark_is_set_later(tmp_path):
    folder = tmp_path / "state"
    mark = UnwrittenMark(folder, "one")
    mark.put(unwritten=True)
    assert mark.others == []
    folder.mkdir()
    mark.put(unwritten=True)
    assert marks_in(folder) == ["one"]


def test_a_mark_that_may_not_be_on_the_medium_is_still_its_own_to_remove(tmp_path, monkeypatch):
    def fails(_folder):
        raise OSError("input/output error")

    monkeypatch.setattr(unwritten_mark, "_synchronise", fails)
    mark = UnwrittenMark(tmp_path, "one")
    mark.put(unwritten=True)
    assert marks_in(tmp_path) == ["one"]
    mark.put(unwritten=False)
    assert marks_in(tmp_path) == []


def test_a_mark_that_another_removed_is_set_again_for_the_next_stop(tmp_path):
    mark = UnwrittenMark(tmp_path, "one")
    mark.put(unwritten=True)
    remove([mark_of(tmp_path, "one")])
    mark.put(unwritten=False)
    mark.put(unwritten=True)
    assert marks_in(tmp_path) == ["one"]
