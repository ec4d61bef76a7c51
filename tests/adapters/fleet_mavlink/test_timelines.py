"""Every recording of a real autopilot gives the timeline that is checked in beside it."""

from pathlib import Path

import pytest

DATA = Path(__file__).parents[2] / "data" / "mavlink"
RECORDINGS = sorted(DATA.glob("*.tlog"))


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda path: path.stem)
def test_a_recording_gives_its_timeline(module_at, recording):
    expected = recording.with_suffix(".timeline").read_text().splitlines()
    assert module_at("data/mavlink/timelines.py").timeline(recording) == expected


def test_every_recording_has_a_timeline_and_is_small():
    assert len(RECORDINGS) >= 9
    assert {path.stem for path in RECORDINGS} == {path.stem for path in DATA.glob("*.timeline")}
    assert sum(path.stat().st_size for path in DATA.iterdir() if path.is_file()) < 2_000_000
