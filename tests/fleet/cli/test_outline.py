"""What a stop needs of a fleet file is read though all else is wrong, and what cannot be read is named."""

import json

import pytest

from fleet.cli.outline import outline


@pytest.fixture
def read(tmp_path):
    """Read a text as a fleet file; give what is found."""

    def read(text, **environ):
        file = tmp_path / "fleet.yaml"
        file.write_text(text if isinstance(text, str) else json.dumps(text))
        return outline(str(file), environ)

    return read


def test_the_edge_and_its_bus_are_read_and_nothing_else(read):
    found = read({"edge": {"id": "yard"}, "bus": {"connect": ["tcp/10.0.0.1:1", 7]}, "robots": "nonsense"})
    assert (found.settings.edge, found.settings.connect, found.problems) == ("yard", ("tcp/10.0.0.1:1",), ())
    assert (found.settings.user, found.settings.password) == (None, None)
    assert not found.settings.tls.mutual


@pytest.mark.parametrize(
    "text",
    [
        "edge:\n  id: yard\n  name: [\n",
        'edge: {id: "yard", broken\n',
        '{"edge": {"id": "yard", "x": \n',
        "edge: {id: 'yard'\nrobots: [",
        'edge:\n  "id" : "yard"\n\tx: 1\n',
    ],
)
def test_the_id_is_found_in_a_section_that_is_broken(read, text):
    found = read(text)
    assert found.settings.edge == "yard"
    assert found.problems, "what is wrong is told all the same"


@pytest.mark.parametrize("text", ["", "[]", "7", "bus: {}", "edge: {}", "edge: {id: [1]}", "edge: {id: Y!}"])
def test_an_edge_that_cannot_be_read_is_said(read, text, tmp_path):
    found = read(text)
    assert found.settings.edge == ""
    assert f"{tmp_path / 'fleet.yaml'}: it cannot be read which edge it is for" in found.problems


def test_a_file_that_is_not_there_is_said(tmp_path):
    found = outline(str(tmp_path / "gone.yaml"), {})
    assert found.settings.edge == ""
    assert any("gone.yaml" in problem for problem in found.problems)
    assert all("\n" not in problem for problem in found.problems)


def test_a_password_comes_from_the_environment(read):
    text = "edge: {id: yard}\nbus: {user: anna, password: '${SECRET}'}"
    found = read(text, SECRET="1234")
    assert (found.settings.user, found.settings.password, found.problems) == ("anna", "1234", ())


@pytest.mark.parametrize("bus", ["{user: anna}", "{password: '1234'}", "{user: anna, password: '${SECRET}'}"])
def test_a_user_without_a_password_or_the_other_way_round_is_tried_without(read, bus, tmp_path):
    found = read(f"edge: {{id: yard}}\nbus: {bus}")
    assert (found.settings.edge, found.settings.user, found.settings.password) == ("yard", None, None)
    assert any("bus.user and bus.password cannot both be read" in each for each in found.problems)


@pytest.mark.parametrize("value", ["", [1], {"a": 1}, None])
def test_a_user_and_a_password_that_are_no_text_are_none(read, value):
    found = read({"edge": {"id": "yard"}, "bus": {"user": value, "password": value}})
    assert (found.settings.user, found.settings.password, found.problems) == (None, None, ())


def test_a_password_of_digits_is_text(read):
    found = read({"edge": {"id": "yard"}, "bus": {"user": "anna", "password": 1234}})
    assert found.settings.password == "1234"


def test_certificates_are_beside_the_file(read, tmp_path):
    tls = {"root_ca": "ca.pem", "cert": "/etc/edge.pem", "key": "edge.key"}
    found = read({"edge": {"id": "yard"}, "bus": {"tls": tls}}).settings.tls
    assert found.root_ca == str(tmp_path / "ca.pem")
    assert found.certificate == "/etc/edge.pem"
    assert found.key == str(tmp_path / "edge.key")


@pytest.mark.parametrize(
    ("tls", "mutual", "verify"),
    [
        ({}, False, True),
        ({"root_ca": "ca.pem"}, True, True),
        ({"root_ca": "ca.pem", "mutual": False}, False, True),
        ({"root_ca": "ca.pem", "verify_name": False}, True, False),
        ("nonsense", False, True),
    ],
)
def test_a_certificate_is_shown_and_the_name_verified_unless_said_otherwise(read, tls, mutual, verify):
    found = read({"edge": {"id": "yard"}, "bus": {"tls": tls}}).settings.tls
    assert (found.mutual, found.verify_name) == (mutual, verify)
