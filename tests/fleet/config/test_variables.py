"""Environment variables inside values."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.variables import UndefinedVariable, expand

ENVIRON = {"HOST": "h", "PORT": "88", "EMPTY": "", "_x1": "y", "ODD": "${HOST} $$ }"}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("${HOST}:${PORT}", "h:88"),
        ("${_x1}", "y"),
        ("${EMPTY}", ""),
        ("${HOST:-other}", "h"),
        ("${NO:-other}", "other"),
        ("${NO:-}", ""),
        ("${EMPTY:-other}", "other"),
        ("${NO:-a b:c-d?e}", "a b:c-d?e"),
        ("${HOST:?say the host}", "h"),
        ("$$", "$"),
        ("$${HOST}", "${HOST}"),
        ("$$${HOST}", "$h"),
        ("$HOST 5$ a$b", "$HOST 5$ a$b"),
        ("{HOST}", "{HOST}"),
        ("", ""),
    ],
)
def test_variables_are_replaced_and_nothing_else_is(text, value):
    assert expand(text, ENVIRON) == value


def test_the_value_of_a_variable_is_not_expanded_again():
    assert expand("${ODD}", ENVIRON) == "${HOST} $$ }"


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("a ${NO}", "the environment variable NO is not set", "set it, or give a default: ${NO:-value}"),
        ("${NO:?name the host}", "the environment variable NO is not set", "name the host"),
        ("${EMPTY:?name it}", "the environment variable EMPTY is not set", "name it"),
        ("${NO:?}", "the environment variable NO is not set", ""),
    ],
)
def test_a_variable_without_a_value_is_an_error_with_its_remedy(text, message, hint):
    with pytest.raises(UndefinedVariable) as caught:
        expand(text, ENVIRON)
    assert (str(caught.value), caught.value.hint) == (message, hint)


@pytest.mark.parametrize("wrong", ["${}", "${no way}", "${1A}", "${A-B}", "${A:=b}", "${\u00e4}", "${open"])
def test_what_is_no_variable_is_an_error_that_shows_how_to_write_one(wrong):
    with pytest.raises(UndefinedVariable) as caught:
        expand(f"x {wrong}", {"A": "1", "1A": "1"})
    assert str(caught.value) == f"{wrong} is no variable"
    assert caught.value.hint == "write ${NAME} or ${NAME:-default}; a plain dollar is $$"


@given(st.text(alphabet="ab ${}:-?$\n"))
def test_a_dollar_that_is_doubled_is_always_a_dollar(text):
    assert expand(text.replace("$", "$$"), {}) == text
