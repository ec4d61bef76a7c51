"""Where a console looks for recordings: in the folders it was given, and in those of the edges."""

from fleet.console.task import ConsoleTask


def test_it_looks_into_its_own_folders_and_those_of_each_edge_once(tmp_path):
    mine, theirs = tmp_path / "mine", tmp_path / "edges" / "yard-1" / "recordings"
    task = ConsoleTask("x", recordings=(str(mine), str(theirs)), beside=str(tmp_path / "edges"))
    assert task.recordings_now() == [mine, theirs]
    for edge in ("yard-1", "shed-1"):
        (tmp_path / "edges" / edge / "recordings").mkdir(parents=True)
    assert task.recordings_now() == [mine, theirs, tmp_path / "edges" / "shed-1" / "recordings"]


def test_one_that_was_given_no_place_looks_nowhere():
    assert ConsoleTask("x").recordings_now() == []
