import click.testing
import pytest

from fleet.errors import ConfigError, LinkRefused
from fleet_quadruped.cli import can
from fleet_quadruped.robot.description import EXAMPLE


def run(*arguments):
    return click.testing.CliRunner().invoke(can, [str(text) for text in arguments], standalone_mode=False)


def test_a_good_description_is_reported_with_its_load():
    result = run("check", EXAMPLE)
    assert result.return_value == 0
    assert "bus a: 40% of 1000000 bit/s at 100 cycles a second" in result.output


def test_a_bad_description_is_reported(write_dog):
    result = run("check", write_dog(("mass: 12.6", "mass: -1")))
    assert isinstance(result.exception, ConfigError)


@pytest.mark.parametrize("command", ["check", "monitor"])
def test_buses_that_the_description_does_not_have_are_refused(command):
    result = run(command, EXAMPLE, "--bus", "b=can:virtual:x")
    assert isinstance(result.exception, LinkRefused)


def test_calibrating_asks_first():
    result = click.testing.CliRunner().invoke(can, ["calibrate", str(EXAMPLE)], input="n\n")
    assert result.exit_code == 1
    assert "Is the dog in the pose" in result.output
