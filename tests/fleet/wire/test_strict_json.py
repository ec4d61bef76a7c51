import contextlib
import json
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire import strict_json

LEAVES = (
    st.none() | st.booleans() | st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False) | st.text()
)
VALUES = st.recursive(
    LEAVES.filter(lambda value: not (isinstance(value, float) and math.isinf(value))),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=20,
)


@given(VALUES)
def test_every_json_value_comes_back_as_it_was(value):
    assert strict_json.parse_json(json.dumps(value).encode()) == value


@given(VALUES)
def test_escaped_and_plain_characters_read_the_same(value):
    assert strict_json.parse_json(json.dumps(value, ensure_ascii=False).encode()) == value


def repeat_a_key(value, data):
    """Write a JSON text in which one of the objects, if there is any, has a key twice."""
    texts = []

    def write(node):
        if isinstance(node, dict):
            texts.extend(node)
            return "{" + ",".join(f"{json.dumps(key)}:{write(child)}" for key, child in node.items()) + "}"
        return "[" + ",".join(map(write, node)) + "]" if isinstance(node, list) else json.dumps(node)

    text = write(value)
    key = json.dumps(data.draw(st.sampled_from(texts))) if texts else None
    return None if key is None else text.replace(f"{key}:", f"{key}:0,{key}:", 1)


@given(VALUES, st.data())
def test_a_key_that_stands_twice_is_found_wherever_it_is(value, data):
    text = repeat_a_key(value, data)
    assume(text is not None)
    with pytest.raises(WireError, match="twice"):
        strict_json.parse_json(text.encode())


@given(st.binary(max_size=200))
def test_arbitrary_bytes_raise_nothing_but_a_wire_error(payload):
    with contextlib.suppress(WireError):
        strict_json.parse_json(payload)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "not JSON at character 0"),
        (b"{'a': 1}", "not JSON"),
        (b'{"a": 1} x', "Extra data"),
        (b'{"a": 1}{"a": 2}', "Extra data"),
        (b'{"a": NaN}', "NaN is not a number"),
        (b'{"a": Infinity}', "Infinity is not a number"),
        (b'{"a": -Infinity}', "-Infinity is not a number"),
        (b'{"a": 1e999}', "1e999 is too large"),
        (b'{"a": -1e999}', "too large"),
        (b'{"a": 9223372036854775808}', "too large"),
        (b'{"a": 1' + b"0" * 5000 + b"}", "too large"),
        (b'{"a": 1, "a": 2}', "'a' stands twice"),
        (b'{"x": {"b": 1, "b": 1}}', "'b' stands twice"),
        (b'{"a": "\\ud800"}', "surrogate"),
        (b'{"\\udfff": 1}', "surrogate"),
        (b"\xff\xfe", "not UTF-8 at byte 0"),
        (b'{"a": "\xc3\x28"}', "not UTF-8 at byte 7"),
        (json.dumps({"a": 1}).encode("utf-16"), "not UTF-8"),
        (b'\xef\xbb\xbf{"a": 1}', "not JSON"),
        (b'{"a": "\x01"}', "control character"),
    ],
)
def test_what_is_not_strict_json_is_refused_with_the_reason(payload, reason):
    with pytest.raises(WireError, match=reason.replace("(", r"\(")):
        strict_json.parse_json(payload)


def test_a_whole_surrogate_pair_is_a_character():
    assert strict_json.parse_json(b'"\\ud83d\\ude80"') == "\N{ROCKET}"


def test_the_largest_integers_of_64_bits_are_read():
    assert strict_json.parse_json(b"[9223372036854775807,-9223372036854775807]") == [2**63 - 1, 1 - 2**63]


def test_more_bytes_than_the_limit_are_refused_before_they_are_parsed():
    with pytest.raises(WireError, match="1048577 bytes are more than the 1048576"):
        strict_json.parse_json(b"x" * ((1 << 20) + 1))
    assert strict_json.parse_json(b"[1]", limit=3) == [1]
    with pytest.raises(WireError, match="more than the 2"):
        strict_json.parse_json(b"[1]", limit=2)


@pytest.mark.parametrize("opening", [b"[", b'{"a":', b'[{"a":'])
def test_a_million_nested_brackets_are_refused_without_a_recursion_error(opening):
    with pytest.raises(WireError):
        strict_json.parse_json(opening * 1_000_000, limit=1 << 24)
    closed = b"[" * 500_000 + b"]" * 500_000
    with pytest.raises(WireError, match="nested deeper than 32"):
        strict_json.parse_json(closed)


@pytest.mark.parametrize("depth", [1, 2, 32])
def test_the_depth_is_counted_exactly(depth):
    assert strict_json.parse_json(b"[" * depth + b"]" * depth, depth=depth) is not None
    with pytest.raises(WireError, match=f"deeper than {depth}"):
        strict_json.parse_json(b"[" * (depth + 1) + b"]" * (depth + 1), depth=depth)


def test_brackets_in_strings_and_in_a_row_are_not_depth():
    assert strict_json.parse_json(json.dumps("[{" * 100).encode()) == "[{" * 100
    assert strict_json.parse_json(b"[" + b"[]," * 99 + b"{}]", depth=2) == [[]] * 99 + [{}]


@pytest.mark.parametrize("payload", [b"[]", b'"x"', b"5", b"null", b"true"])
def test_only_an_object_is_an_object(payload):
    with pytest.raises(WireError, match="a JSON object is needed, this is"):
        strict_json.parse_object(payload)


@pytest.mark.parametrize("wrong", ["5", True, None, [1], {}, math.nan, math.inf])
def test_a_number_is_nothing_else(wrong):
    with pytest.raises(WireError) as refusal:
        strict_json.number({"linear_x": wrong}, "linear_x", "data")
    assert refusal.value.where == "data.linear_x"
    assert str(refusal.value).startswith("data.linear_x: ")


def test_a_missing_number_is_refused_and_an_optional_one_is_none():
    with pytest.raises(WireError, match="linear_x: is missing"):
        strict_json.number({}, "linear_x")
    assert strict_json.optional_number({}, "linear_x") is None
    with pytest.raises(WireError, match="this is null"):
        strict_json.optional_number({"linear_x": None}, "linear_x")
    assert strict_json.optional_number({"linear_x": 2}, "linear_x") == 2.0


def test_a_whole_number_may_have_a_point_but_no_fraction():
    assert strict_json.whole({"n": 3.0}, "n") == 3
    with pytest.raises(WireError, match="whole number"):
        strict_json.whole({"n": 3.5}, "n")


@pytest.mark.parametrize(("read", "right"), [(strict_json.text, "a"), (strict_json.child, {})])
def test_the_other_kinds_are_as_strict(read, right):
    assert read({"f": right}, "f") == right
    with pytest.raises(WireError, match="f: is missing"):
        read({}, "f")
    with pytest.raises(WireError, match="this is a number"):
        read({"f": 1}, "f")
