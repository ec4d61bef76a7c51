"""``fleet restore``: what it refuses."""

import pytest


@pytest.fixture
def state(place, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(place / "var"))
    return place / "var" / "fleet" / "yard-1"


def test_nothing_is_restored_below_an_edge_that_runs(fleet, place, state, play_edge):
    assert fleet("backup", "-o", "a.backup").code == 0
    play_edge("yard-1")
    done = fleet("restore", "a.backup")
    assert (done.code, "edge yard-1 runs here: stop it first" in done.err) == (1, True)
    assert not state.exists()


def test_a_file_that_is_no_backup_is_refused(fleet, place, runtime):
    done = fleet("restore", "fleet.yaml")
    assert (done.code, "no complete backup" in done.err) == (1, True)
