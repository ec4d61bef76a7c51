"""The file of people: for its user alone, replaced as a whole, strictly read."""

import json
import os

import pytest

from fleet.console.people import (
    People,
    PeopleError,
    Person,
    add_person,
    change_person,
    name_problem,
    read_people,
    remove_person,
)
from fleet.model.permission import Permission

ANNA = Person("anna", "operate", "$argon2id$x")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state" / "console-people.json"


def test_people_are_added_changed_and_removed_in_a_file_for_its_user_alone(path):
    add_person(path, ANNA)
    add_person(path, Person("ben", "view", "y"))
    assert path.stat().st_mode & 0o777 == 0o600
    change_person(path, "anna", permission="view")
    change_person(path, "ben", password="z")
    assert read_people(path) == {
        "anna": Person("anna", "view", "$argon2id$x"),
        "ben": Person("ben", "view", "z"),
    }
    remove_person(path, "ben")
    assert list(read_people(path)) == ["anna"]
    assert read_people(path)["anna"].allowed is Permission.VIEW
    assert [each.name for each in path.parent.iterdir() if each.suffix not in {".json", ".lock"}] == []


def test_nobody_is_added_twice_or_changed_without_being_there(path):
    add_person(path, ANNA)
    with pytest.raises(PeopleError, match="anna is there already"):
        add_person(path, ANNA)
    for change in (lambda: remove_person(path, "eve"), lambda: change_person(path, "eve")):
        with pytest.raises(PeopleError, match="no person eve"):
            change()


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o602])
def test_a_file_that_others_may_read_or_write_lets_nobody_in(path, mode):
    add_person(path, ANNA)
    path.chmod(mode)
    people = People(path)
    assert people.find("anna") is None
    assert f"chmod 600 {path}" in people.problem


@pytest.mark.parametrize(
    "content",
    [
        "",
        "garbage",
        "[]",
        '{"people": [{"name": "anna"}]}',
        '{"people": [{"name": "anna", "permission": "root", "password": "x"}]}',
        '{"people": [{"name": "anna", "permission": "view", "password": "x", "more": 1}]}',
        '{"people": [{"name": "-f", "permission": "view", "password": "x"}]}',
        '{"format": 0, "people": []}',
        json.dumps({"people": [{"name": "anna", "permission": "view", "password": "x"}] * 2}),
        '{"people": []}' + " " * (1 << 20),
    ],
)
def test_a_damaged_file_lets_nobody_in(path, content):
    path.parent.mkdir()
    path.write_text(content)
    path.chmod(0o600)
    with pytest.raises(PeopleError, match=r"damaged|more than"):
        read_people(path)


def test_a_file_of_a_newer_fleet_is_reported_as_such(path):
    path.parent.mkdir()
    path.write_text('{"format": 2, "everyone": []}')
    path.chmod(0o600)
    with pytest.raises(PeopleError, match="it has format 2, of a newer fleet"):
        read_people(path)


def test_a_link_to_another_file_is_not_followed(path, tmp_path):
    add_person(tmp_path / "other.json", ANNA)
    path.parent.mkdir()
    path.symlink_to(tmp_path / "other.json")
    with pytest.raises(PeopleError, match="cannot be read"):
        read_people(path)


def test_a_running_console_sees_each_change_and_a_damage(path):
    people = People(path)
    assert people.is_empty()
    assert people.problem == ""
    add_person(path, ANNA)
    assert people.knows(ANNA)
    change_person(path, "anna", permission="view")
    assert not people.knows(ANNA)
    assert people.find("anna") == Person("anna", "view", ANNA.password)
    path.write_text("garbage")
    os.utime(path, (1, 1))
    assert people.find("anna") is None
    assert "damaged" in people.problem


@pytest.mark.parametrize("name", ["", "-x", ".x", "a b", "a/b", "a\n", "é", "x" * 65])
def test_names_are_plain(name):
    assert "a name has" in name_problem(name)
    assert name_problem("anna.berg@site-1") == ""
