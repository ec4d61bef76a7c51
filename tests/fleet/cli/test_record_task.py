"""What ``record:`` of fleet.yaml means for the recorder beside its edge."""

from fleet.cli.record_task import folder_of, record_task
from fleet.config.load import load
from fleet.record.task import MIB


def loaded(place, text):
    (place / "fleet.yaml").write_text((place / "fleet.yaml").read_text() + text)
    return load(place / "fleet.yaml").config


def test_a_recorder_records_its_own_edge_within_its_bounds(place):
    config = loaded(place, "record: {folder: box, size: 32, hours: 1, free: 100}\n")
    task = record_task(config, config.record)
    assert (task.folder, task.only, [each.edge for each in task.edges]) == (
        str(place / "box"),
        True,
        ["yard-1"],
    )
    bounds = task.bounds
    assert (bounds.size, bounds.age, bounds.file_size, bounds.free) == (32 * MIB, 3600, 2 * MIB, 100 * MIB)


def test_left_out_the_folder_is_that_of_the_edge(place, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(place))
    assert folder_of(loaded(place, "record: {}\n")) == place / "fleet" / "yard-1" / "recordings"
