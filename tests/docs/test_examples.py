"""Every example is a mission that can be started."""

import pathlib

import pytest

from fleet.config.missions import KnownNames, read_mission

EXAMPLES = sorted((pathlib.Path(__file__).parents[2] / "examples").glob("*.yaml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_valid(path):
    mission = read_mission(path, {}, KnownNames())
    given = {name: each.sample for name, each in mission.config.inputs.items()}
    program = mission.program(given)
    assert program.steps
    assert mission.config.summary


def test_there_are_examples():
    assert len(EXAMPLES) >= 5
