"""``fleet backup``: one file that is restored elsewhere, and what is left to a person."""

import pytest


@pytest.fixture
def state(place, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(place / "var"))
    return place / "var" / "fleet" / "yard-1"


def test_a_backup_is_one_file_and_is_restored_elsewhere(fleet, place, state, runtime):
    made = fleet("backup", "-o", "a.backup", "--json")
    assert made.code == 0, made.err
    assert "config/plugins/toy.py" in made.json["files"]
    done = fleet("restore", "a.backup", "--config", "new", "--json")
    assert (done.code, done.json["state"]) == (0, str(state))
    assert (place / "new" / "fleet.yaml").read_text() == (place / "fleet.yaml").read_text()
    assert (state / "journal.db").exists()


def test_what_is_left_to_a_person_is_reported_by_both(fleet, place, state, runtime):
    (place / "secrets.yaml").write_text("cyberwave_token: THE-VALUE\n")
    (place / "secrets.yaml").chmod(0o600)
    made = fleet("backup", "-o", "a.backup")
    assert ("cyberwave_token" in made.err, "THE-VALUE" in made.err) == (True, False)
    done = fleet("restore", "a.backup")
    assert "write secrets.yaml (mode 600) with: cyberwave_token" in done.err
    assert "fleet release" in done.err
