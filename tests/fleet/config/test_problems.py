import pytest

from fleet.config.problems import InvalidConfig, Mark, dotted, masked, problem_at
from fleet.errors import ConfigError


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("token: abc", "token: ***"),
        ("  tokn: 'a b'", "  tokn: *****"),
        ('"password": "a,b"  # x', '"password": *****  # x'),
        ("cloud: {host: h, token: abc, port: x}", "cloud: {host: h, token: ***, port: x}"),
        ("signing_key: abc", "signing_key: ***"),
        ("pin: 1234", "pin: ****"),
        ("password: a b, {c} # d", "password: ************"),
        ('password: "a\\"b" # c', "password: ****** # c"),
        ("{password: a b, host: h}", "{password: ***, host: h}"),
        ("token: !secret name", "token: !secret name"),
        ("password: ${PW}", "password: ${PW}"),
        ("link: udp:1", "link: udp:1"),
        ("keepalive: 5", "keepalive: 5"),
    ],
)
def test_a_line_is_shown_without_its_secrets(line, shown):
    assert masked(line) == shown


def test_a_path_is_written_as_people_write_it():
    assert dotted(("robots", 0, "limits", "speed")) == "robots[0].limits.speed"


def test_a_problem_cannot_steer_the_terminal():
    problem = problem_at(Mark("f\x1b", 1, 1, ("\x1b[2J",)), "a\nb", text="\x1b[0m", hint="\x07")
    assert problem.shown().replace("\n    ", "").isprintable()


def test_a_very_long_line_is_not_shown():
    assert problem_at(Mark("f", 1, 400), "m", text="x" * 500).shown() == "f:1:400: m"


def test_an_invalid_config_lists_its_problems_in_the_order_of_the_file():
    late, early = (problem_at(Mark("f", line, 1), "m") for line in (9, 2))
    error = InvalidConfig([late, early, late])
    assert isinstance(error, ConfigError)
    assert error.problems == [early, late]
    assert str(error) == "f:2:1: m\nf:9:1: m"
