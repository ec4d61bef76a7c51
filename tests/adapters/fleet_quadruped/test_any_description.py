"""A file is read as the kind of machine that it describes, and refused as that kind."""

import pytest

from fleet.errors import ConfigError
from fleet_quadruped.any_description import load_body
from fleet_quadruped.robot.description import EXAMPLE, DogDescription
from fleet_quadruped.selfwalk.description import SelfWalker


@pytest.fixture
def refused(tmp_path):
    """Return what reads a text as a description and returns why it is refused."""

    def read(text):
        path = tmp_path / "rex.yaml"
        path.write_text(text)
        with pytest.raises(ConfigError, match=r"rex\.yaml") as caught:
            load_body(path)
        return str(caught.value)

    return read


@pytest.mark.parametrize(
    ("name", "kind"),
    [("example", DogDescription), ("self-walking", SelfWalker), ("self-walking-canopen", SelfWalker)],
)
def test_each_example_is_read_as_its_kind(name, kind):
    assert type(load_body(EXAMPLE.with_name(f"{name}.yaml"))) is kind


@pytest.mark.parametrize("section", ["frames", "objects"])
def test_a_section_of_its_frames_makes_it_a_machine_that_walks_by_itself(refused, section):
    problems = refused(f"robot: {{name: rex, mass: 12}}\n{section}: {{}}\n")
    assert "silence: Field required" in problems
    assert "joints" not in problems


def test_without_one_it_is_a_dog_with_joints_of_ours(refused):
    problems = refused("robot: {name: rex, mass: 12}\n")
    assert "joints: Field required" in problems
    assert "silence" not in problems


@pytest.mark.parametrize("text", ["", "frames", "[frames, objects]", "3"])
def test_what_is_no_description_at_all_is_refused_as_a_dog(refused, text):
    assert "frames: Field required" not in refused(text)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml"):
        load_body(tmp_path / "none.yaml")
