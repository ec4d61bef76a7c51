"""The recorder between the bus and the disk: bounded, and told when the disk is full."""

import os

import msgspec
import pytest

from fleet.history.record import Record
from fleet.missions.report import RunState
from fleet.model.event import EventKind
from fleet.record import recorder as module
from fleet.record.recorder import AGAIN, Recorder
from fleet.record.ring import Ring, files_in
from fleet.record.task import Bounds
from fleet.testing.clock import ManualClock


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def recorder(tmp_path, clock):
    recorder = Recorder(Ring(tmp_path / "recordings", Bounds(free=0, age=1e12)), clock)
    yield recorder
    recorder.close()


def test_samples_and_events_are_recorded_when_they_came(recorder, clock, tmp_path, read_back):
    recorder.add_many("yard-1", [("fleet/yard-1/places/main", b"{}"), ("fleet/yard-1/held", b"")])
    clock.advance(1.0)
    recorder.add_events("yard-1", [Record(1.0, "rex", EventKind.STOP, "stopped")])
    recorder.write()
    found = read_back(tmp_path / "recordings")
    assert [topic for topic, _, _ in found] == ["/yard-1/places/main", "/yard-1/rex/history"]
    assert found[1][2].log_time - found[0][2].log_time == pytest.approx(1e9, abs=1e3)
    assert (recorder.recorded, recorder.problem) == (2, "")


def test_each_file_tells_which_missions_were_under_way_when_it_began(recorder, clock, tmp_path, read_back):
    runs = [RunState(run, "yard-1", "round", "step", "way", 1.0) for run in ("r1", "r2")]
    ended = RunState("r2", "yard-1", "round", "ended", "", 1.0, outcome="completed")
    for run in (*runs, ended):
        recorder.add("yard-1", f"fleet/yard-1/runs/{run.run}", msgspec.json.encode(run))
    recorder.write()
    clock.advance(Bounds().file_age)
    recorder.add("yard-1", "fleet/yard-1/held", b"{}")
    recorder.write()
    first, second = files_in(tmp_path / "recordings")
    assert [topic for topic, _, _ in read_back(first)] == ["/yard-1/runs"] * 3
    found = read_back(second)
    assert [topic for topic, _, _ in found] == ["/yard-1/runs", "/yard-1/held"]
    assert msgspec.json.decode(found[0][2].data)["run"] == "r1"


def test_nothing_that_came_leaves_no_file(recorder, tmp_path):
    recorder.write()
    assert files_in(tmp_path / "recordings") == []


def test_what_does_not_fit_into_memory_is_dropped_and_reported(recorder, monkeypatch):
    monkeypatch.setattr(module, "MOST_WAITING", 10)
    recorder.add_many("yard-1", [("fleet/yard-1/places/main", b'{"a": 1}')] * 3)
    recorder.write()
    assert recorder.problem.startswith("2 samples were not recorded: the disk")
    recorder.write()
    assert recorder.problem == ""


def test_a_full_disk_ends_recording_is_reported_and_tried_again(
    recorder, clock, tmp_path, read_back, monkeypatch
):
    def say():
        recorder.add("yard-1", "fleet/yard-1/places/main", b"{}")
        recorder.write()

    def full(*_):
        raise OSError(28, "No space left on device")

    say()
    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        say()
        assert recorder.problem == "nothing is recorded: No space left on device"
    say()
    assert recorder.problem
    clock.advance(AGAIN)
    say()
    assert (recorder.problem, len(read_back(tmp_path / "recordings"))) == ("", 2)
