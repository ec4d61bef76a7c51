"""No secret of a fleet leaves this computer in an exported text, however it is written."""

import json
from urllib.parse import quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.masking import MASK, Masking, kept_secrets, secrets_in
from fleet.config.yaml import SHORTEST_SECRET

SECRETS = st.text(min_size=SHORTEST_SECRET, max_size=20).filter(
    lambda text: len(text.strip()) >= SHORTEST_SECRET and "*" not in text
)


@given(SECRETS, st.text(max_size=10), st.text(max_size=10))
def test_no_secret_stays_in_a_text_in_any_notation(secret, before, after):
    mask = Masking([secret])
    for form in (secret, json.dumps(secret)[1:-1], quote(secret), quote(secret, safe=""), repr(secret)[1:-1]):
        assert form not in mask.text(f"{before}{form}{after}")
        assert mask.finds(f"{before}{form}{after}".encode())


@pytest.mark.parametrize(
    "form",
    ['a"b/\u00e4\\d', r"a\"b/\u00e4\\d", 'a\\"b/\u00e4\\\\d', "a%22b/%C3%A4%5Cd", "a%22b%2F%C3%A4%5Cd"],
)
def test_each_notation_is_masked_as_a_whole(form):
    assert Masking(['a"b/\u00e4\\d']).text(f"x {form} y") == f"x {MASK} y"


def test_each_line_of_a_secret_is_a_secret():
    mask = Masking(["first-line\nsecond-line\n"])
    assert mask.text("a first-line b") == f"a {MASK} b"
    assert mask.text("second-line") == MASK


def test_the_longest_secret_is_masked_as_a_whole():
    assert Masking(["pass", "password-1"]).text("password-1 pass") == f"{MASK} {MASK}"


def test_what_is_too_short_to_be_told_from_ordinary_text_is_left():
    mask = Masking(["abc", "", "abcd"])
    assert mask.text("abc abcd") == f"abc {MASK}"


def test_without_secrets_nothing_is_found():
    assert not Masking([]).finds(b"anything")
    assert not Masking(["abc"]).finds(b"abc")
    assert Masking(["abcd"]).finds(b"\xff\xfeabcd\xff")
    assert not Masking(["abcd"]).finds(b"abce")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("tcp://anna:hunter2@host:1883/x", "tcp://****@host:1883/x"),
        ("redis://:hunter2@host/0", "redis://****@host/0"),
        ("https://host:8080/a@b", "https://host:8080/a@b"),
        ("see https://host/x: and a@b", "see https://host/x: and a@b"),
        ("mqtt://anna@host", "mqtt://anna@host"),
        ("Authorization: Bearer abcdefgh1234", "Authorization: Bearer ****"),
        ("authorization: basic YW5uYTpodW50ZXIy", "authorization: basic ****"),
        ("a bearer of news", "a bearer of news"),
        ("rex: stopped", "rex: stopped"),
    ],
)
def test_what_looks_like_a_secret_is_masked_though_nobody_knows_it(text, shown):
    assert Masking(()).text(text) == shown


def test_a_configuration_file_loses_its_secrets_and_the_values_of_secret_keys():
    lines = [
        "a: known-secret  \n",
        "password: unknown\n",
        "token: !secret cloud\n",
        "\n",
        "b: {pin: 1234, c: 2}\n",
    ]
    assert Masking(["known-secret"]).config(lines) == (
        "a: ****\npassword: *******\ntoken: !secret cloud\n\nb: {pin: ****, c: 2}\n"
    )


def test_the_secrets_of_a_fleet_come_from_its_file_its_keys_its_webhooks_and_its_environment(reading):
    document = reading(
        "cloud: {token: in-line, user_password: [one, 2, {a: three, b: true, c: null}]}\n"
        "notify: [{url: https://hook/x}, {command: [y]}, 5]\n"
        "x: ${WORD}\n"
    )
    document.secrets.add("from-secret")
    environ = {
        "CYBERWAVE_API_KEY": "env-key",
        "DB_PASSWORD": "env-pass",
        "HOME": "/home/anna",
        "EMPTY_TOKEN": "",
    }
    assert secrets_in(document, ["kept"], environ) == {
        "from-secret",
        "kept",
        "in-line",
        "one",
        "2",
        "three",
        "https://hook/x",
        "env-key",
        "env-pass",
        "",
    }


@pytest.mark.parametrize("text", ["[1]\n", "notify: 5\n", "notify: {url: x}\n", "null\n"])
def test_a_file_of_another_shape_has_no_webhooks(reading, text):
    assert secrets_in(reading(text), [], {}) == set()


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"token: abc\nother: 'd e'\n", {"abc", "d e"}),
        (b'token: "quo\\"ted"\n', {'quo"ted', 'quo\\"ted'}),
        (b"a: {b: nested}\n", {"nested"}),
        (b"token: |\n  first\n  second\n", {"first\nsecond\n"}),
        (b"token: [abc\nother: def\n", {"[abc", "def"}),
        (b"token: \xff\xfe\n", {"\ufffd\ufffd"}),
        (b"# nothing\n", set()),
        (b"", set()),
    ],
)
def test_the_values_of_a_secrets_file_are_found_even_if_it_is_invalid(tmp_path, content, found):
    path = tmp_path / "secrets.yaml"
    path.write_bytes(content)
    assert found <= set(kept_secrets(path))
    assert "" not in kept_secrets(path)


def test_without_a_secrets_file_nothing_is_kept(tmp_path):
    assert kept_secrets(tmp_path / "secrets.yaml") == []
    assert kept_secrets(tmp_path) == []
