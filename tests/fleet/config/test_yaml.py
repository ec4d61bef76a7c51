import os

import pytest

from fleet.config.yaml import read


def problems_of(document):
    return [f"{each.line}:{each.column}: {each.message}" for each in document.problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("yes", "yes"),
        ("on", "on"),
        ("NO", "NO"),
        ("0755", "0755"),
        ("1_000", "1_000"),
        ("12:30:00", "12:30:00"),
        ("2026-01-01", "2026-01-01"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("-17", -17),
        ("0x1F", 31),
        ("0o17", 15),
        ("1.5e3", 1500.0),
        (".5", 0.5),
        ("-.inf", float("-inf")),
        ("'5'", "5"),
        ("1.2.3", "1.2.3"),
    ],
)
def test_words_mean_what_yaml_1_2_says(reading, text, value):
    assert reading(f"a: {text}\n").data == {"a": value}


def test_every_value_has_a_place(reading):
    document = reading("a:\n  b: [1, x]\n")
    mark = document.marks["a", "b", 1]
    assert (mark.line, mark.column, mark.path) == (2, 10, ("a", "b", 1))
    assert document.keys["a", "b"].column == 3


@pytest.mark.parametrize(
    ("text", "place_and_message"),
    [
        ("a: 1\na: 2\n", "2:1: the key is there twice, first in line 1"),
        ("a: &a [*a]\n", "1:4: an alias that contains itself"),
        ("a: *b\n", "1:4: found undefined alias"),
        ("a: !!python/object:os.system x\n", "1:4: the tag tag:yaml.org,2002:python/object:os.system is not"),
        ("a: !!python/tuple [1]\n", "1:4: the tag tag:yaml.org,2002:python/tuple is not allowed"),
        ("a: !include\n  - x\n", "1:4: the tag !include is not allowed"),
        ("a:\n\tb: 1\n", "2:1: a tab cannot indent; use spaces"),
        ("a: \x1b[2J\n", "1:4: the character U+001B is not allowed in YAML"),
        (b"a: 1\nb: \xff\n", "2:4: the file is not UTF-8 text"),
        (b"\xff\xfea\x00", "1:1: the file is not UTF-8 text"),
        ("a: [1\nb: 2\n", "2:2: did not find expected ',' or ']'"),
        ("a: 1\n---\nb: 2\n", "2:1: but found another document"),
        ("? [1]\n: 2\n", "1:3: a key must be a plain word"),
        ("a: " + "[" * 100_000, "1:43: nested deeper than 40 levels"),
        ("a: " + "x" * 1_000_001, "1:1: the file is longer than 1000000 bytes"),
    ],
    ids=range(15),
)
def test_what_is_no_plain_yaml_is_reported_with_its_place(reading, text, place_and_message):
    document = reading(text)
    assert problems_of(document)[0].startswith(place_and_message)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a: {b: ${C}}\n", '"${NAME}"'),
        ("a: [1\nb: 2\n", "closing bracket"),
        ("a: [\n", "closing bracket"),
        ("a: 1\n  b: 2\n", "indent it as the lines around it"),
        ("- a\nb: 1\n", "indent it as the lines around it"),
        ("a:\n  b: 1\n c: 2\n", "indent it as the lines around it"),
        ("a: 'x\n", "closing quote"),
        ("a: 1\nb\nc: 2\n", "followed by a colon"),
        ("a: *b\n", "must be quoted"),
    ],
)
def test_what_is_no_yaml_is_reported_with_what_it_probably_wants(reading, text, hint):
    (problem,) = reading(text).problems
    assert hint in problem.hint


def test_aliases_that_multiply_are_stopped(reading):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 12)]
    document = reading("\n".join(lines))
    assert "more than 100000 values" in problems_of(document)[0]
    assert () in document.spoiled


def test_aliases_that_nest_ever_deeper_are_stopped(reading):
    deep = [f"a{n}: &a{n} {'[' * 30}*a{n - 1}{']' * 30}" for n in range(1, 60)]
    assert "nested too deeply" in problems_of(reading("\n".join(["a0: &a0 x", *deep])))[0]


def test_variables_are_filled_in(reading):
    document = reading("a: ${HOST}:${PORT:-88}\nb: $$5 $x\n", {"HOST": "h"})
    assert document.data == {"a": "h:88", "b": "$5 $x"}
    assert document.texts == {("a",), ("b",)}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("${NO}", "1:4: the environment variable NO is not set"),
        ("${NO:?name the host}", "1:4: the environment variable NO is not set"),
        ("${no way}", "1:4: ${no way} is no variable"),
        ("'${open'", "1:4: ${open is no variable"),
    ],
)
def test_a_variable_without_a_value_is_reported(reading, text, message):
    document = reading(f"a: {text}\n")
    assert problems_of(document) == [message]
    assert document.data == {"a": None}


def test_an_included_file_keeps_its_own_places(reading, tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "rex.yaml").write_text("name: rex\nlegs: !include four.yaml\n")
    (tmp_path / "robots" / "four.yaml").write_text("4\n")
    document = reading("robots:\n  - !include robots/rex.yaml\n")
    assert document.data == {"robots": [{"name": "rex", "legs": 4}]}
    mark = document.marks["robots", 0, "name"]
    assert (mark.file, mark.line) == (str(tmp_path / "robots" / "rex.yaml"), 1)


@pytest.mark.parametrize("name", ["../secret.yaml", "/etc/hostname", "link.yaml", "sub/../../x.yaml"])
def test_nothing_outside_the_folder_is_included(tmp_path, name):
    folder = tmp_path / "config"
    folder.mkdir()
    (tmp_path / "secret.yaml").write_text("canary: 1\n")
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    (folder / "fleet.yaml").write_text(f"a: !include {name}\n")
    document = read(folder / "fleet.yaml", {})
    assert document.data == {"a": None}
    assert "is outside the folder" in document.problems[0].message


def test_files_that_include_each_other_are_reported(reading, tmp_path):
    (tmp_path / "other.yaml").write_text("b: !include fleet.yaml\n")
    assert problems_of(reading("a: !include other.yaml\n")) == ["1:4: fleet.yaml includes itself"]


def test_an_include_that_is_not_there_is_reported_where_it_is_asked_for(reading):
    assert problems_of(reading("a: 1\nb: !include none.yaml\n"))[0].startswith("2:4: cannot read")


class TestSecrets:
    @pytest.fixture
    def secrets(self, tmp_path):
        def secrets(text, mode=0o600):
            path = tmp_path / "secrets.yaml"
            path.write_text(text)
            path.chmod(mode)

        return secrets

    def test_a_secret_comes_from_the_file_beside(self, reading, secrets):
        secrets("token: 00123\n")
        document = reading("a: !secret token\n")
        assert document.data == {"a": "00123"}

    @pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o610])
    def test_a_file_that_others_can_read_is_refused(self, reading, secrets, mode):
        secrets("token: canary\n", mode)
        document = reading("a: !secret token\n")
        assert document.data == {"a": None}
        assert "others can read it" in document.problems[0].message

    @pytest.mark.parametrize("text", ["token: [1]", "- token", "token", "token: 'canary", "\ttoken: canary"])
    def test_a_broken_file_is_reported_without_its_text(self, reading, secrets, text):
        secrets(text)
        (problem,) = reading("a: !secret token\n").problems
        assert problem.line == 1
        assert "canary" not in problem.shown()

    def test_a_misspelt_secret_is_reported_with_the_nearest(self, reading, secrets):
        secrets("cyberwave_token: x\n")
        (problem,) = reading("a: !secret cyberwave_tokn\n").problems
        assert problem.hint == "did you mean 'cyberwave_token'?"

    def test_each_use_of_a_missing_file_is_reported(self, reading):
        assert len(reading("a: !secret x\nb: !secret y\n").problems) == 2


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir], ids=["a FIFO", "a folder"])
@pytest.mark.parametrize("text", ["a: !include it\n", "a: !secret it\n"])
def test_what_is_no_regular_file_is_refused_and_never_waited_for(reading, tmp_path, make, text):
    make(tmp_path / ("it" if "include" in text else "secrets.yaml"), 0o600)
    (problem,) = problems_of(reading(text))
    assert "no regular file" in problem
