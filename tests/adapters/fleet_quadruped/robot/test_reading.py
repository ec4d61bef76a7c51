"""A description from YAML: every problem with its file and its place, and what was meant."""

import pytest

from fleet import ConfigError
from fleet_quadruped.robot.parts import Gait, Section, Wiring
from fleet_quadruped.robot.reading import checked, read_tree


class Two(Section):
    """Two sections, one below the other."""

    joint: Wiring
    gait: Gait = Gait()


GOOD = {"bus": "a", "id": 3}


@pytest.fixture
def file(tmp_path):
    def file(content):
        path = tmp_path / "dog.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return file


def refused(call, *given):
    with pytest.raises(ConfigError) as caught:
        call(*given)
    return str(caught.value)


def test_a_tree_is_what_is_in_the_file(file):
    assert read_tree(file("a: {x: 1, y: [1.5, b]}\n")) == {"a": {"x": 1, "y": [1.5, "b"]}}
    assert read_tree(file("")) is None


@pytest.mark.parametrize(
    ("text", "line", "key"),
    [("a: 1\nb: 2\na: 3\n", 3, "a"), ("legs:\n  hip: 1\n  hip: 2\n", 3, "hip"), ("{x: 1, x: 2}", 1, "x")],
)
def test_a_key_that_is_there_twice_is_refused_with_its_line(file, text, line, key):
    path = file(text)
    assert refused(read_tree, path) == f"{path}:{line}: the key {key!r} is there twice"


def test_one_key_in_two_sections_is_no_duplicate(file):
    assert read_tree(file("a: {x: 1}\nb: {x: 2}\n")) == {"a": {"x": 1}, "b": {"x": 2}}


def test_what_is_no_yaml_is_refused_with_its_line(file):
    path = file("a: 1\nb: [1, 2\nc: 3\n")
    assert refused(read_tree, path).startswith(f"{path}:3: ")


def test_a_file_that_is_not_there_is_refused_by_the_systems_words(tmp_path):
    path = tmp_path / "none.yaml"
    assert refused(read_tree, path) == f"{path}: No such file or directory"
    assert refused(read_tree, tmp_path) == f"{tmp_path}: Is a directory"


def test_what_is_no_text_is_refused(file):
    path = file(b"name: \xff\xfe\n")
    assert refused(read_tree, path) == f"{path}: is not UTF-8 text"


def test_no_object_is_made_from_a_tag(file):
    assert "could not determine a constructor" in refused(
        read_tree, file("a: !!python/object/apply:os.getcwd []")
    )


def test_a_tree_that_is_right_is_its_section(tmp_path):
    two = checked(tmp_path, {"joint": GOOD | {"sign": -1}}, Two)
    assert (two.joint.id, two.joint.sign, two.gait) == (3, -1, Gait())


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ({"id": 3}, "joint.bus: Field required"),
        (GOOD | {"id": 200}, "joint.id: Input should be less than or equal to 127, not 200"),
        (GOOD | {"sign": 2}, "joint.sign: Input should be -1 or 1, not 2"),
        (GOOD | {"ofset": 0.1}, "joint.ofset: unknown key, did you mean 'offset'?"),
        (GOOD | {"zzz": 0.1}, "joint.zzz: unknown key"),
        (GOOD | {"offset": float("inf")}, "joint.offset: Input should be a finite number, not inf"),
        ([], "joint: Input should be a valid dictionary or instance of Wiring"),
    ],
)
def test_a_problem_is_told_with_its_place_and_what_was_given(tmp_path, joint, words):
    assert refused(checked, tmp_path, {"joint": joint}, Two) == f"{tmp_path}: {words}"


def test_a_key_of_another_section_is_suggested_too(tmp_path):
    words = refused(checked, tmp_path, {"joint": GOOD, "gate": {}}, Two)
    assert words == f"{tmp_path}: gate: unknown key, did you mean 'gait'?"


def test_all_problems_are_told_at_once(tmp_path):
    words = refused(checked, tmp_path, {"joint": {"id": 0}, "gait": {"duty": 2}}, Two)
    assert words.count(";") == 2
    for place in ("joint.bus", "joint.id", "gait.duty"):
        assert place in words


@pytest.mark.parametrize("tree", [None, [], "dog", 5])
def test_a_file_that_is_no_mapping_is_refused(tmp_path, tree):
    assert "dictionary" in refused(checked, tmp_path, tree, Two)
