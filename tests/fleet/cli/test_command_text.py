"""Declared commands in words: what must be given, within which bounds, and what else happens."""

import pytest

from fleet.cli import command_text
from fleet.cli.command_text import parameters, usage
from fleet.model.description import CommandDescription, ParameterDescription


class Out:
    """What is shown, line by line."""

    def __init__(self):
        self.lines, self.rows = [], []

    def say(self, line):
        self.lines.append(line)

    def table(self, head, rows):
        self.head, self.rows = head, list(rows)


def shown(**fields):
    out = Out()
    command_text.show(out, CommandDescription("takeoff", **fields))
    return out


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        (ParameterDescription("altitude", "number", required=True), "altitude=NUMBER"),
        (ParameterDescription("speed", "number"), "[speed=NUMBER]"),
        (ParameterDescription("at", "list of numbers"), "[at=LIST-OF-NUMBERS]"),
    ],
)
def test_a_parameter_that_may_be_left_out_is_in_brackets(parameter, text):
    assert usage(parameter) == text


def test_a_command_shows_its_parameters_in_order_or_a_dash():
    both = ParameterDescription("b", "text", required=True), ParameterDescription("a", "number")
    assert parameters(CommandDescription("go", parameters=both)) == "b=TEXT [a=NUMBER]"
    assert parameters(CommandDescription("go")) == "-"


@pytest.mark.parametrize(
    ("fields", "row"),
    [
        ({"least": 1.0, "most": 120.0, "unit": "m", "required": True}, ("1 to 120 m", "(must be given)")),
        ({"least": 1.0, "default": "5"}, ("at least 1", "5")),
        ({"most": 2.5, "unit": "m/s"}, ("at most 2.5 m/s", "-")),
        ({"unit": "m"}, ("m", "-")),
        ({}, ("-", "-")),
        ({"least": 0.0, "most": 0.0}, ("0 to 0", "-")),
        ({"required": True, "default": "5"}, ("-", "(must be given)")),
    ],
)
def test_a_parameter_is_shown_with_its_bounds_unit_and_default(fields, row):
    out = shown(parameters=(ParameterDescription("altitude", "number", **fields),))
    assert out.head == ("parameter", "type", "range", "default")
    assert out.rows == [("altitude", "number", *row)]


@pytest.mark.parametrize(
    ("fields", "lines"),
    [
        ({}, ["does not move the robot"]),
        ({"moves": True, "timeout": 60.0}, ["may move the robot; given up after 60 s"]),
        (
            {"summary": "Land here.", "moves": True, "safe": True, "timeout": 2.5},
            ["Land here.", "may move the robot; taken during an emergency stop; given up after 2.5 s"],
        ),
    ],
)
def test_a_command_says_what_it_does_to_the_robot(fields, lines):
    out = shown(**fields)
    assert (out.lines, out.rows) == (lines, [])
