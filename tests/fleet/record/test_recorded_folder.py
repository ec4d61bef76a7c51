"""A moment of a recording: what was newest then, from as little of the files as needed."""

import pytest

from fleet.record import recorded_folder
from fleet.record.recorded_folder import RecordedFolder
from tests.tools.recordings import write_recording

BEGINS = 1_795_000_000.0
SECONDS = 30


@pytest.fixture(params=[True, False], ids=["finished", "in progress"])
def folder(request, tmp_path):
    """Return the folder of a recording that is finished, or still written."""
    ring = write_recording(tmp_path / "recordings", BEGINS, SECONDS, ends=request.param)
    yield tmp_path / "recordings"
    if not request.param:
        ring.close()


def newest(found, topic):
    return next(message for message in found if message.topic == topic)


@pytest.mark.parametrize("second", [0.0, 4.25, 12.0, 29.9])
def test_a_moment_has_the_newest_of_each_topic_and_nothing_that_came_later(folder, second):
    found = RecordedFolder(folder).at(BEGINS + second)
    assert max(message.received for message in found) <= BEGINS + second
    for robot in ("rex", "ann"):
        assert newest(found, f"/yard-1/{robot}/state").received == BEGINS + int(second)
        assert newest(found, f"/yard-1/{robot}/position").received == BEGINS + int(second * 2) / 2
    topics = [message.topic for message in found if message.schema not in recorded_folder.SEVERAL]
    assert len(topics) == len(set(topics))


def test_runs_and_events_of_long_before_are_found_without_reading_all_that_lies_between(folder, monkeypatch):
    monkeypatch.setattr(recorded_folder, "MOST_CHUNKS", 8)
    found = RecordedFolder(folder).at(BEGINS + 29.0)
    assert [message.received - BEGINS for message in found if message.topic == "/yard-1/runs"] == [15.0, 5.0]
    assert newest(found, "/yard-1/rex/history").received == BEGINS + 10.0


def test_a_track_has_as_many_instants_as_wanted_and_no_more(folder):
    track = RecordedFolder(folder).track(BEGINS + 20.0, 10.0, 5)
    own = [message.received - BEGINS for message in track if message.topic == "/yard-1/rex/position"]
    assert 5 <= len(own) <= 6
    assert (own[0], own == sorted(own)) == (10.0, True)


def test_what_is_written_meanwhile_is_found_at_the_next_moment(tmp_path):
    ring = write_recording(tmp_path / "recordings", BEGINS, 5, ends=False)
    seen = RecordedFolder(tmp_path / "recordings")
    assert len(seen.at(BEGINS + 60)) == 8
    file = ring.file(BEGINS + 5)
    assert newest(seen.at(BEGINS + 60), "/yard-1/rex/state").received == BEGINS + 4.0
    file.flush()
    ring.close()
    assert seen.extent()[0] == BEGINS


def test_a_file_that_is_cut_off_or_damaged_tells_what_is_left_of_it(tmp_path):
    write_recording(tmp_path / "recordings", BEGINS, SECONDS)
    (path,) = (tmp_path / "recordings").glob("*.mcap")
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 200] = bytes(200)
    path.write_bytes(data[: 3 * len(data) // 4])
    found = RecordedFolder(tmp_path / "recordings").at(BEGINS + 2.0)
    assert newest(found, "/yard-1/rex/state").received == BEGINS + 2.0


def test_a_folder_without_recordings_tells_nothing(tmp_path):
    (tmp_path / "other.mcap").write_bytes(b"no recording")
    empty = RecordedFolder(tmp_path)
    assert (empty.extent(), empty.at(BEGINS), empty.track(BEGINS, 10.0, 5)) == (None, [], [])
