"""``fleet record``: into a folder for a while, what it holds, and a window of it."""

import pytest

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture(autouse=True)
def without_records(monkeypatch):
    """Keep the priority of the tests; the recorder asks to have a lower one."""
    given = []
    monkeypatch.setattr("fleet.cli.record.lower_priority", lambda: given.append(True))
    return given


def test_what_was_recorded_for_a_while_is_listed_and_exported(fleet, runtime, play_edge, place):
    play_edge("yard-1", robots={"rex": {"twin": TWIN}})
    made = fleet("record", "--into", "mine", "--for", "1.5s", "--json")
    assert (made.code, made.json["problem"]) == (0, "")
    assert made.json["messages"] >= 2
    (listed,) = fleet("record", "ls", "--from", "mine", "--json").json
    assert listed["messages"] == made.json["messages"]
    exported = fleet("record", "export", "window.mcap", "--from", "mine", "--since", "1h", "--json")
    assert exported.json == {"file": "window.mcap", "messages": made.json["messages"]}


def test_a_folder_that_others_read_is_refused(fleet, runtime, place):
    (place / "open").mkdir()
    (place / "open").chmod(0o755)
    result = fleet("record", "--into", "open")
    assert (result.code, "chmod 700" in result.err) == (1, True)


@pytest.mark.parametrize("length", ["soon", "10", "-1s"])
def test_a_length_that_is_none_is_refused(fleet, place, length):
    result = fleet("record", "--for", length)
    assert (result.code, "write 30s, 10min or 1h" in result.err) == (2, True)


def test_without_the_extra_it_says_what_to_install(fleet, place, monkeypatch):
    monkeypatch.setattr("fleet.cli.record.is_installed", lambda: False)
    for arguments in (("record",), ("record", "ls"), ("record", "export", "x.mcap")):
        assert "zenoh-fleet[record]" in fleet(*arguments).err


def test_the_folder_of_a_fleet_file_is_looked_into(fleet, place):
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(f"{text}record: {{folder: box}}\n")
    assert f"there is no folder {place / 'box'}" in fleet("record", "ls", "-f", "fleet.yaml").err
