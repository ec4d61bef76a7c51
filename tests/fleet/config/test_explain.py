"""Errors of a model in plain words, at their line, with what was probably meant."""

from pathlib import Path
from typing import Annotated, Literal
from uuid import UUID

import pytest
from pydantic import Field, SecretStr, model_validator

from fleet.config.explain import fields_of, validated, validated_with
from fleet.robot_config import Name
from fleet.yaml_model import Model, wrong

UUID_HINT = "like 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11; the twin's page in the cloud shows it"


class Part(Model):
    size: int = Field(1, ge=1, le=9, description="Its size.")


class Thing(Model):
    name: Name = "rex"
    speed: float = Field(1.0, gt=0, lt=5, description="Speed, m/s.")
    count: int = Field(1, description="How many.")
    on: bool = True
    mode: Literal["slow", "fast"] = "slow"
    twin: UUID | None = None
    words: tuple[str, ...] = ()
    pair: tuple[int, int] = Field((1, 2), description="Two numbers.")
    parts: dict[Name, Part] = {}
    part: Part = Part()
    some: Annotated[tuple[Part, ...], Field(min_length=1, max_length=2)] = (Part(),)
    three: Annotated[tuple[int, ...], Field(min_length=3)] = (1, 2, 3)
    text: Annotated[str, Field(min_length=1)] = "x"
    code: Annotated[str, Field(pattern="^[0-9]+$")] = "1"
    folder: Path = Path()
    secret: SecretStr = SecretStr("")
    inbound: int = 0
    keyed: int = Field(0, alias="from")

    @model_validator(mode="after")
    def _checked(self):
        if self.count == 13:
            raise wrong("speed", "thirteen is not allowed")
        if self.count == 14:
            raise ValueError("there is no gear 'fats'; there are slow, fast")
        return self


class Needs(Model):
    must: int = Field(description="A number.")


@pytest.fixture
def explained(reading):
    """Return the problems of a section as ``line:column: path: message (hint)``."""

    def explained(text, model=Thing, environ=None):
        document = reading(f"x: 1\nit: {text}\n", environ)
        assert validated(model, document.data["it"], ("it",), document, {}) is None
        return [
            f"{each.line}:{each.column}: {each.path}: {each.message}"
            + (f" ({each.hint})" if each.hint else "")
            for each in document.problems
        ]

    return explained


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{speed: 0}", "2:13: it.speed: must be more than 0.0 (Speed, m/s.)"),
        ("{speed: 5}", "2:13: it.speed: must be less than 5.0 (Speed, m/s.)"),
        ("{speed: .nan}", "2:13: it.speed: must be a finite number (Speed, m/s.)"),
        ("{speed: '2'}", "2:13: it.speed: must be a number (write it without quotes)"),
        ("{speed: 2 m/s}", "2:13: it.speed: must be a number (write the number alone, without 'm/s')"),
        ("{speed: fast}", "2:13: it.speed: must be a number (Speed, m/s.)"),
        ("{count: 1.5}", "2:13: it.count: must be a whole number (How many.)"),
        ("{on: yes}", "2:10: it.on: must be true or false (did you mean true?)"),
        ("{on: 'OFF'}", "2:10: it.on: must be true or false (did you mean false?)"),
        ("{on: flase}", "2:10: it.on: must be true or false (did you mean false?)"),
        ("{mode: fats}", "2:12: it.mode: must be 'slow' or 'fast' (did you mean 'fast'?)"),
        (
            "{twin: x}",
            f"2:12: it.twin: must be a uuid ({UUID_HINT})",
        ),
        ("{words: a}", "2:13: it.words: must be a list (write [...] around it)"),
        ("{words: [1]}", "2:14: it.words[0]: must be text (write it in quotes)"),
        (
            "{name: Rex}",
            "2:12: it.name: must be lower-case letters, digits, - and _, beginning with a letter",
        ),
        ("{code: x}", "2:12: it.code: must match ^[0-9]+$"),
        ("{text: ''}", "2:12: it.text: must not be empty"),
        ("{some: []}", "2:12: it.some: must not be empty"),
        ("{some: [{}, {}, {}]}", "2:12: it.some: must have at most 2 entries"),
        ("{part: 5}", "2:12: it.part: must be a mapping of  key: value"),
        ("{parts: [1]}", "2:13: it.parts: must be a mapping of  key: value"),
        ("{part: {size: 0}}", "2:19: it.part.size: must be at least 1 (Its size.)"),
        ("{parts: {a: {size: 10}}}", "2:24: it.parts.a.size: must be at most 9 (Its size.)"),
        (
            "{parts: {A: {}}}",
            "2:14: it.parts.A: must be lower-case letters, digits, - and _, beginning with a letter",
        ),
        ("{pair: [1]}", "2:12: it.pair: item 2 of the list is missing (Two numbers.)"),
        ("{count: 13, speed: 2}", "2:17: it.speed: thirteen is not allowed"),
        ("{count: 13}", "2:5: it: thirteen is not allowed"),
        ("{count: 14}", "2:5: it: there is no gear 'fats'; there are slow, fast (did you mean 'fast'?)"),
    ],
)
def test_an_error_is_told_in_plain_words_with_what_was_probably_meant(explained, text, problem):
    assert explained(text) == [problem]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{speeed: 1}", "2:6: it.speeed: unknown key (did you mean 'speed'?)"),
        ("{part: {sise: 1}}", "2:13: it.part.sise: unknown key (did you mean 'size'?)"),
        ("{some: [{sise: 1}]}", "2:14: it.some[0].sise: unknown key (did you mean 'size'?)"),
        ("{parts: {a: {zzz: 1}}}", "2:18: it.parts.a.zzz: unknown key (known are size)"),
        ("{listen: 1}", "2:6: it.listen: unknown key (it is called inbound now)"),
        ("{keyed: 1}", "2:6: it.keyed: unknown key"),
    ],
)
def test_an_unknown_key_is_reported_at_the_key(explained, text, problem):
    (found,) = explained(text)
    assert found.startswith(problem)


def test_a_missing_key_is_reported_unless_a_misspelt_one_is_it(explained):
    assert explained("{}", Needs) == ["2:5: it: the key 'must' is missing (A number.)"]
    assert explained("{msut: 1}", Needs) == ["2:6: it.msut: unknown key (did you mean 'must'?)"]
    assert len(explained("{other: 1}", Needs)) == 2


def test_a_list_is_called_too_short_only_when_it_is(explained):
    """Pydantic does not count the items that have an error."""
    assert explained("{three: [1, x, 3]}") == ["2:17: it.three[1]: must be a whole number"]
    assert explained("{three: [1, x]}") == [
        "2:17: it.three[1]: must be a whole number",
        "2:13: it.three: must have at least 3 entries",
    ]


def test_every_error_is_reported(explained):
    assert len(explained("{speed: 0, count: x, mode: y, zzz: 1}")) == 4


def test_a_value_that_could_not_be_read_is_reported_once(explained):
    assert explained("{speed: '${NO}'}") == [
        "2:13: it.speed: the environment variable NO is not set (set it, or give a default: ${NO:-value})"
    ]


@pytest.mark.parametrize(
    ("text", "field", "value"),
    [("'2.5'", "speed", 2.5), ("'7'", "count", 7), ("'false'", "on", False), ("'007'", "text", "007")],
)
def test_the_text_of_a_variable_may_stand_for_a_number_or_a_boolean(reading, text, field, value):
    document = reading(f"it: {{{field}: '${{VALUE}}'}}\n", {"VALUE": text.strip("'")})
    found, data = validated_with(Thing, document.data["it"], ("it",), document, {})
    assert getattr(found, field) == value
    assert data == {field: value}


def test_the_text_of_a_variable_that_is_no_number_is_an_error_and_the_data_is_left_as_it_was(explained):
    assert explained("{count: '${VALUE}'}", environ={"VALUE": "many"}) == [
        "2:13: it.count: must be a whole number (How many.)"
    ]


def test_what_is_valid_is_a_model_and_nothing_is_reported(reading):
    document = reading("it: {speed: 2, words: [a], from: 3}\n")
    thing = validated(Thing, document.data["it"], ("it",), document, {})
    assert (thing.speed, thing.words, thing.keyed, document.problems) == (2.0, ("a",), 3, [])


def test_the_value_of_a_secret_is_not_in_its_error(reading):
    document = reading("it: {count: '${TOKEN}'}\n", {"TOKEN": "canary-1234"})
    document.secrets.add("canary-1234")
    validated(Thing, document.data["it"], ("it",), document, {})
    assert "canary" not in "".join(problem.shown() for problem in document.problems)


def test_fields_are_known_by_their_keys_in_the_file():
    assert "from" in fields_of(Thing)
    assert "keyed" not in fields_of(Thing)
