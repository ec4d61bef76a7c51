"""``fleet console people``: who may log in, with passwords that no command line and no output has."""

import io
import json

import pytest

from fleet.console.passwords import verify_password
from fleet.console.people import read_people

PASSWORD = "correct horse battery"


@pytest.fixture
def path(place):
    with (place / "fleet.yaml").open("a") as file:
        file.write("console: {people: people.json}\n")
    return place / "people.json"


@pytest.fixture
def typed(monkeypatch):
    """Give a password on the standard input."""
    return lambda text: monkeypatch.setattr("sys.stdin", io.StringIO(f"{text}\n"))


def test_people_are_added_listed_changed_and_removed(fleet, path, typed):
    typed(PASSWORD)
    result = fleet("console", "people", "add", "anna", "--permission", "operate")
    assert (result.code, result.out) == (0, "anna may log in, with the permission operate\n")
    kept = path.read_text()
    assert PASSWORD not in kept + result.out + result.err
    assert verify_password(read_people(path)["anna"].password, PASSWORD)
    listed = json.loads(fleet("console", "people", "list", "--json").out)
    assert listed == {"file": str(path), "people": [{"name": "anna", "permission": "operate"}]}
    assert "$argon2id" not in fleet("console", "people", "list").out
    assert "sessions end" in fleet("console", "people", "permit", "anna", "view").out
    assert read_people(path)["anna"].permission == "view"
    typed("another horse battery")
    assert fleet("console", "people", "password", "anna").code == 0
    assert verify_password(read_people(path)["anna"].password, "another horse battery")
    assert fleet("console", "people", "remove", "anna").code == 0
    assert "no login is possible" in fleet("console", "people", "list").out


@pytest.mark.parametrize(
    ("given", "text", "why"),
    [
        (("add", "anna"), "short", "at least 12 characters"),
        (("add", "anna"), "", "at least 12 characters"),
        (("add", "a b"), PASSWORD, "a name has"),
        (("remove", "eve"), "", "has no person eve"),
        (("password", "eve"), PASSWORD, "has no person eve"),
        (("permit", "eve", "view"), "", "has no person eve"),
    ],
)
def test_what_cannot_be_done_is_reported_and_changes_nothing(fleet, path, monkeypatch, *, given, text, why):
    monkeypatch.setattr("sys.stdin", io.StringIO(f"{text}\n"))
    result = fleet("console", "people", *given)
    assert (result.code != 0, why in result.err) == (True, True)
    assert not read_people(path)


def test_a_password_is_no_argument(fleet, path):
    assert fleet("console", "people", "add", "anna", PASSWORD).code == 2
