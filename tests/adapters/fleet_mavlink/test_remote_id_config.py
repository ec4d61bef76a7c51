"""Section remote_id: what a transmitter can carry, and a mistake that is told before a flight."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet_mavlink.remote_id_config import RemoteIdConfig

PLACE = {"latitude": 47.4, "longitude": 8.5}
WIDTHS = {"operator_id": 20, "serial_number": 20, "description": 23}  # bytes on the wire
texts = pytest.mark.parametrize("field", WIDTHS)


def config(**fields):
    return RemoteIdConfig.model_validate(PLACE | fields)


def test_a_place_is_enough_and_the_rest_is_told_as_unknown():
    known = config()
    assert (known.operator_id, known.serial_number, known.description) == ("", "", "")
    assert (known.altitude, known.category, known.class_eu) == (-1000.0, "undeclared", 0)


@pytest.mark.parametrize("missing", PLACE)
def test_without_the_operators_place_there_is_no_remote_id(missing):
    with pytest.raises(ValidationError, match=missing):
        RemoteIdConfig.model_validate({name: PLACE[name] for name in PLACE if name != missing})


@texts
@pytest.mark.parametrize("text", ["Zürich", "a\nb", "a\0b", "a\tb", "\x7f", "東京"])
def test_what_remote_id_cannot_carry_is_refused(field, text):
    with pytest.raises(ValidationError, match="printable ASCII characters only"):
        config(**{field: text})


@texts
def test_a_text_fills_its_field_and_not_a_character_more(field):
    longest = "x" * WIDTHS[field]
    assert getattr(config(**{field: longest}), field) == longest
    with pytest.raises(ValidationError, match=f"at most {WIDTHS[field]} characters"):
        config(**{field: longest + "x"})


@given(st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=20))
def test_every_printable_text_is_kept_as_it_is(text):
    assert config(operator_id=text).operator_id == text


@pytest.mark.parametrize(
    ("field", "lowest", "highest", "step"),
    [
        ("latitude", -90.0, 90.0, 0.001),
        ("longitude", -180.0, 180.0, 0.001),
        ("altitude", -1000.0, 31767.0, 0.5),
        ("class_eu", 0, 7, 1),
    ],
)
def test_a_number_is_within_what_the_message_has_room_for(field, lowest, highest, step):
    for inside in (lowest, highest):
        assert getattr(config(**{field: inside}), field) == inside
    for outside in (lowest - step, highest + step, float("nan")):
        with pytest.raises(ValidationError, match=field):
            config(**{field: outside})


@pytest.mark.parametrize("category", ["undeclared", "open", "specific", "certified"])
def test_the_categories_are_the_european_unions(category):
    assert config(category=category).category == category


@pytest.mark.parametrize("wrong", [{"category": "private"}, {"operatorid": "x"}, {"class_eu": 1.5}])
def test_a_misspelt_field_or_value_is_refused(wrong):
    with pytest.raises(ValidationError):
        config(**wrong)
