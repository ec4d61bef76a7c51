"""A disk that is full, read-only, or forgets."""

import pytest

from fleet.doctor.disk import DiskState, check_disk, read_disk, size_of
from fleet.doctor.finding import Rating

GIB = 1 << 30


@pytest.mark.parametrize(
    ("faults", "verdict", "words"),
    [
        ({}, Rating.OK, "10240 MiB free"),
        ({"read_only": True}, Rating.ERROR, "read-only"),
        ({"free": 1000}, Rating.ERROR, "no room"),
        ({"inodes": 3}, Rating.ERROR, "no room"),
        ({"free": GIB // 4}, Rating.WARNING, "the edge may write 1024 MiB more"),
        ({"kind": "tmpfs"}, Rating.WARNING, "lost with the power"),
    ],
)
def test_a_disk_is_judged(tmp_path, faults, verdict, words):
    found = check_disk(DiskState(**{"folder": tmp_path, "free": 10 * GIB} | faults), GIB)
    assert (found.verdict, words in found.found) == (verdict, True)
    assert bool(found.cure) == (verdict is not Rating.OK)


def test_a_folder_that_does_not_exist_yet_is_judged_by_the_one_above(tmp_path):
    mounts = tmp_path / "mounts"
    mounts.write_text(f"/dev/sda1 / ext4 rw 0 0\ntmpfs {tmp_path} tmpfs rw 0 0\n")
    found = read_disk(tmp_path / "not" / "yet", mounts)
    assert (found.kind, found.free > 0, found.folder) == ("tmpfs", True, tmp_path / "not" / "yet")


def test_the_size_of_a_folder_counts_its_files(tmp_path):
    (tmp_path / "log").mkdir()
    (tmp_path / "a").write_bytes(b"12")
    (tmp_path / "log" / "b").write_bytes(b"345")
    assert size_of(tmp_path) == 5
    assert size_of(tmp_path / "none") == 0
