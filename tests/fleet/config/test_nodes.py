"""Text to YAML nodes, and words to values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.nodes import MAX_BYTES, MAX_DEPTH, BadYaml, compose, decoded, plain, scalar


@pytest.mark.parametrize(
    ("word", "value"),
    [
        *((word, None) for word in ("", "~", "null", "Null", "NULL")),
        *((word, True) for word in ("true", "True", "TRUE")),
        *((word, False) for word in ("false", "False", "FALSE")),
        ("0", 0),
        ("-17", -17),
        ("+5", 5),
        ("0x1F", 31),
        ("0o17", 15),
        ("9" * 31, int("9" * 31)),
        ("9" * 32, 1e32),
        ("1.5e3", 1500.0),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-0.0", -0.0),
        ("1e400", math.inf),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("+.Inf", math.inf),
    ],
)
def test_a_word_is_a_value_of_yaml_1_2(word, value):
    assert plain(word) == value
    assert type(plain(word)) is type(value)


@pytest.mark.parametrize("word", [".nan", ".NaN", ".NAN"])
def test_what_is_not_a_number_is_nan(word):
    assert math.isnan(plain(word))


@pytest.mark.parametrize(
    "word",
    [
        *("yes", "no", "on", "off", "y", "nUll", "tRue"),
        *("0755", "00", "0b11", "1_000", "12:30", "0x", "-0x1F", "0o8", "1e99999", "+", "-", "."),
        *("inf", "nan", "-.nan", "1.2.3", "2026-01-01", "<<", "=", "5 ", "\u0665"),
    ],
)
def test_every_other_word_is_text(word):
    assert plain(word) == word


@given(st.integers(-(10**31) + 1, 10**31 - 1))
def test_whole_numbers_are_read_as_they_are_written(number):
    assert plain(str(number)) == number


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_fractions_are_read_as_they_are_written(number):
    assert plain(repr(number)) == number


@pytest.mark.parametrize("text", ["'5'", '"5"', "|\n 5", ">\n 5"])
def test_quoted_text_stays_text(text):
    assert scalar(compose(f"a: {text}\n").value[0][1]).strip() == "5"


def test_a_plain_scalar_is_a_value():
    assert scalar(compose("5")) == 5
    assert scalar(compose("a: x\n").value[0][1]) == "x"


@pytest.mark.parametrize("text", ["", "\n", "# nothing\n", "---\n...\n"])
def test_a_text_without_content_has_no_or_an_empty_root(text):
    node = compose(text)
    assert node is None or node.value == ""


# -- bytes --------------------------------------------------------------------------------------------


def test_a_text_may_begin_with_a_byte_order_mark():
    assert decoded(b"\xef\xbb\xbfa: \xc3\xa4") == "a: \u00e4"


def test_a_file_is_bounded():
    assert len(decoded(b"x" * MAX_BYTES)) == MAX_BYTES
    with pytest.raises(BadYaml, match="the file is longer than 1000000 bytes"):
        decoded(b"x" * (MAX_BYTES + 1))


@pytest.mark.parametrize(
    ("data", "line", "column"),
    [(b"\xff", 1, 1), (b"ab\xff", 1, 3), (b"a\n\n b\xff", 3, 3), (b"a\n\xc3", 2, 1)],
)
def test_bytes_that_are_no_text_have_a_place(data, line, column):
    with pytest.raises(BadYaml, match="the file is not UTF-8 text") as caught:
        decoded(data)
    assert (caught.value.line, caught.value.column) == (line, column)


# -- what is no YAML ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "column", "code"),
    [
        ("a: \x1b[2J\n", 1, 4, "001B"),
        ("a: 1\nb\x00", 2, 2, "0000"),
        ("\x7f", 1, 1, "007F"),
        ("a: \ufeffb", 1, 4, None),
    ],
)
def test_a_character_that_controls_a_terminal_is_refused_with_its_place(text, line, column, code):
    if code is None:
        assert compose(text) is not None
        return
    with pytest.raises(BadYaml, match=rf"the character U\+{code} is not allowed in YAML") as caught:
        compose(text)
    assert (caught.value.line, caught.value.column) == (line, column)


@pytest.mark.parametrize("brackets", ["[]", "{}"])
def test_a_file_is_not_nested_without_end(brackets):
    opening, closing = ("[", "]") if brackets == "[]" else ("{a: ", "}")
    assert compose(opening * MAX_DEPTH + closing * MAX_DEPTH)
    with pytest.raises(BadYaml, match=f"nested deeper than {MAX_DEPTH} levels") as caught:
        compose("\n" + opening * (MAX_DEPTH + 1) + closing * (MAX_DEPTH + 1))
    assert (caught.value.line, caught.value.column) == (2, len(opening) * MAX_DEPTH + 1)


def test_a_hundred_thousand_brackets_cost_no_stack():
    with pytest.raises(BadYaml, match="nested deeper"):
        compose("[" * 100_000)


def test_siblings_are_not_nested():
    assert len(compose("[" + "[], " * 1000 + "]").value) == 1000


@pytest.mark.parametrize(
    ("text", "line", "column", "message", "hint"),
    [
        ("a:\n\tb: 1\n", 2, 1, "a tab cannot indent; use spaces", ""),
        ("a: [1\nb: 2\n", 2, 2, "did not find expected ',' or ']'", "closing bracket"),
        ("a: {b: ${C}}\n", 1, 9, "did not find expected ',' or '}'", '"${NAME}"'),
        ("a: 1\n  b: 2\n", 2, 4, "mapping values are not allowed", "indent it"),
        ("a: 'x\n", 2, 1, "found unexpected end of stream", "closing quote"),
        ("a: *b\n", 1, 4, "found undefined alias", "must be quoted"),
        ("[1, }\n", 1, 5, "did not find expected node content while parsing a flow node", "closing bracket"),
        ("a: 1\n---\nb: 2\n", 2, 1, "but found another document", ""),
    ],
)
def test_an_error_of_the_parser_has_a_place_and_a_hint(text, line, column, message, hint):
    with pytest.raises(BadYaml) as caught:
        compose(text)
    assert (caught.value.line, caught.value.column) == (line, column)
    assert str(caught.value).startswith(message)
    assert hint in caught.value.hint
    assert bool(hint) is bool(caught.value.hint)
    assert "\n" not in str(caught.value)


def test_an_anchor_cannot_create_an_object():
    node = compose("!!python/object:os.system x")
    assert node.tag == "tag:yaml.org,2002:python/object:os.system"
    assert scalar(node) == "x"


@given(st.text(alphabet="ab:-[]{}'\"#&*!|> \n\t,?", max_size=30))
def test_any_text_is_nodes_or_an_error_with_a_place_in_it_or_at_its_end(text):
    error = None
    try:
        compose(text)
    except BadYaml as bad:
        error = bad
    if error:
        assert 1 <= error.line <= text.count("\n") + 2
        assert error.column >= 1
