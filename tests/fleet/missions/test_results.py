"""What a run leaves behind: tracks and pictures, bounded, and never in a run's way."""

import os
import queue
from pathlib import Path

import pytest

from fleet.missions import results
from fleet.missions.results import Results
from fleet.model.geometry import Vector3


@pytest.fixture
def kept(tmp_path):
    kept = Results(tmp_path)
    yield kept
    kept.close()


def of(kept, run):
    """Return what a run left behind."""
    found = queue.Queue()
    kept.of(run, found.put)
    return found.get(timeout=60)


def test_a_track_has_a_point_a_second_and_is_on_disk_with_the_run(kept):
    for tenth in range(301):
        kept.record_position("r1", "rex", Vector3(tenth / 10, 0.0, 1.0), 1000.0 + tenth / 10)
    kept.record_position("r1", "max", None, 1000.0)
    (early,) = of(kept, "r1")
    assert early.points == 30, "what was written survives the end of the process"
    kept.end("r1")
    (track,) = of(kept, "r1")
    assert (track.kind, track.robot, track.points) == ("track", "rex", 31)
    lines = Path(track.file).read_text().splitlines()
    assert (lines[0], lines[-1]) == ("1000.0,0.00,0.00,1.00", "1030.0,30.00,0.00,1.00")


def test_a_long_track_goes_on_with_fewer_points(kept, monkeypatch):
    monkeypatch.setattr(results, "POINTS", 10)
    for second in range(70):
        kept.record_position("r1", "rex", Vector3(), float(second))
    kept.end("r1")
    (track,) = of(kept, "r1")
    assert track.points == 30, "10 at 1 Hz, 10 at 0.5 Hz, 10 at 0.25 Hz"


def test_pictures_are_kept_up_to_their_bound(kept, monkeypatch):
    monkeypatch.setattr(results, "PICTURES", 2)
    for _ in range(3):
        kept.store_picture("r1", "rex", b"jpeg", "jpeg", 1000.0)
    kept.store_picture("r2", "rex", b"", "../../sh", 1000.0)
    found = of(kept, "r1")
    assert [(each.kind, each.robot, each.bytes) for each in found] == [("picture", "rex", 4)] * 2
    assert of(kept, "r2") == []


def test_the_results_of_the_oldest_runs_are_deleted(kept, tmp_path, monkeypatch):
    monkeypatch.setattr(results, "RUNS", 2)
    for number in range(4):
        run = f"r{number}"
        kept.record_position(run, "rex", Vector3(), 1.0)
        kept.end(run)
        of(kept, run)
        for folder in (tmp_path / "results").iterdir():  # as if it were written a while ago
            os.utime(folder, ns=(0, folder.stat().st_mtime_ns - 10**9))
    assert {path.name for path in (tmp_path / "results").iterdir()} == {"r2", "r3"}
    monkeypatch.setattr(results, "BYTES", 1)
    kept.end("r3")
    of(kept, "r3")
    assert {path.name for path in (tmp_path / "results").iterdir()} == {"r3"}


def test_a_disk_that_cannot_be_written_is_reported_and_holds_up_nobody(tmp_path, caplog):
    (tmp_path / "results").write_text("no folder")
    kept = Results(tmp_path)
    kept.record_position("r1", "rex", Vector3(), 1.0)
    kept.end("r1")
    kept.close()
    assert "results of missions cannot be kept" in caplog.text
