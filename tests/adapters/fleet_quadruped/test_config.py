"""A quadruped's fields in fleet.yaml: real or simulated, and where its captures go."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from fleet_quadruped.config import QuadrupedConfig, simulation
from fleet_quadruped.robot.description import EXAMPLE

BASICS = {"name": "rex", "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", "adapter": "quadruped"}
REAL, SIMULATED = {"buses": {"a": "can:socketcan:can0"}}, {"link": "sim:kinematic"}


def config(**more):
    return QuadrupedConfig.model_validate(BASICS | more)


def refused(**more):
    with pytest.raises(ValidationError) as caught:
        config(**more)
    return str(caught.value)


@pytest.mark.parametrize(
    ("link", "found"),
    [
        ("sim:auto", ("auto", {})),
        ("sim:mujoco", ("mujoco", {})),
        ("sim:kinematic?faults=loss:0.05", ("kinematic", {"loss": 0.05})),
        ("sim:auto?faults=mute:3,loss:0.1", ("auto", {"mute": 3.0, "loss": 0.1})),
        ("sim:auto?faults=tip:0.5", ("auto", {"tip": 0.5})),  # of a self-walking machine
    ],
)
def test_a_simulated_dog_has_a_world_and_faults(link, found):
    assert simulation(link) == found


@pytest.mark.parametrize(
    "link", ["sim:", "sim:moon", "auto", "udp:auto", "sim:auto?loss:0.05", "sim:auto?fault=loss:1"]
)
def test_what_is_no_simulated_dog_is_answered_with_an_example(link):
    with pytest.raises(ValueError, match="is not a simulated dog; write sim:auto or sim:mujoco") as caught:
        simulation(link)
    assert repr(link) in str(caught.value)


def test_a_fault_that_nobody_knows_is_refused():
    with pytest.raises(ValueError, match="flies"):
        simulation("sim:auto?faults=flies:1")
    assert "flies" in refused(link="sim:auto?faults=flies:1")


@pytest.mark.parametrize("both", [REAL | SIMULATED, {}, {"buses": {}}])
def test_a_dog_is_either_real_or_simulated(both):
    assert "give either buses (a real dog) or link: sim:auto (a simulated one)" in refused(**both)


@pytest.mark.parametrize("one", [REAL, SIMULATED])
def test_without_a_description_it_is_the_example_dog(one):
    dog = config(**one)
    assert (dog.body, dog.body_file) == (None, EXAMPLE)
    assert {part.name for part in dog.body_parts()}


def test_the_parts_of_a_machine_that_walks_by_itself_are_unknown():
    walker = EXAMPLE.with_name("self-walking.yaml")
    dog = config(**SIMULATED, body=str(walker))
    assert (dog.body_file, dog.body_parts()) == (walker, ())


@pytest.mark.parametrize(("trim", "fits"), [(0.5, False), (0.51, True), (1.99, True), (2.0, False)])
def test_a_trim_is_a_correction_and_no_other_unit(trim, fits):
    if fits:
        assert config(**SIMULATED, trim=trim).trim == trim
    else:
        assert "trim" in refused(**SIMULATED, trim=trim)


def test_captures_are_kept_by_the_name_of_the_robot_in_the_state_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert config(**SIMULATED).captures_folder == tmp_path / "fleet" / "captures" / "rex"
    monkeypatch.setenv("XDG_STATE_HOME", "")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert config(**SIMULATED).captures_folder == tmp_path / "home/.local/state/fleet/captures/rex"


def test_captures_may_have_a_folder_of_their_own(tmp_path):
    assert config(**SIMULATED, captures=str(tmp_path / "kept")).captures_folder == tmp_path / "kept"
