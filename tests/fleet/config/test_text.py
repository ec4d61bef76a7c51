"""Texts that are shown to people, and texts in the data of a file."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.text import nearest, printable, texts_in


@given(st.text())
def test_nothing_that_controls_a_terminal_is_printed(text):
    assert printable(text).isprintable()


@given(st.text(alphabet=st.characters(categories=["L", "N", "P", "S"])))
def test_printable_text_is_printed_as_it_is(text):
    assert printable(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("", ""),
        ("a\tb", "a b"),
        ("\x1b[2J", "\\x1b[2J"),
        ("a\nb\r", "a\\nb\\r"),
        ("\u202eevil", "\\u202eevil"),
        ("\ud800", "\\ud800"),
        ("gr\u00fcn \U0001f916", "gr\u00fcn \U0001f916"),
    ],
)
def test_a_tab_is_a_space_and_other_controls_are_escapes(text, shown):
    assert printable(text) == shown


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("speeed", "did you mean 'speed'?"),
        ("SPEED", "did you mean 'speed'?"),
        ("altitud", "did you mean 'altitude'?"),
        ("xyz", ""),
        ("", ""),
    ],
)
def test_the_most_similar_word_is_suggested_or_none(word, hint):
    assert nearest(word, ["speed", "altitude"]) == hint


def test_the_suggestion_does_not_depend_on_the_order_of_the_words():
    assert nearest("ac", ["ab", "aa"]) == nearest("ac", ["aa", "ab"])
    assert nearest("speed", []) == ""


def test_every_text_of_a_file_is_found_but_no_key():
    data = {"a": "x", "b": ["y", {"c": "z", "d": 1}, ["w"]], "e": None, "f": True}
    assert list(texts_in(data)) == ["x", "y", "z", "w"]
    assert list(texts_in("alone")) == ["alone"]
    assert list(texts_in(5)) == []
