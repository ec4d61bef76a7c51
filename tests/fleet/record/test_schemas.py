"""The schemas of recorded messages: Foxglove's as published, ours without what Foxglove cannot read."""

import json

import jsonschema
import pytest

from fleet.record.schemas import DOCUMENT, FOXGLOVE, OWN, UNREAD, schema_of

ALL = [*(f"foxglove.{name}" for name in FOXGLOVE), *OWN, DOCUMENT, UNREAD]


@pytest.mark.parametrize("name", ALL)
def test_each_schema_is_one_of_an_object_under_its_name(name):
    schema = json.loads(schema_of(name))
    jsonschema.Draft202012Validator.check_schema(schema)
    assert (schema["title"], schema["type"]) == (name, "object")


@pytest.mark.parametrize("name", OWN)
def test_our_schemas_have_no_references_and_no_unions(name):
    text = schema_of(name).decode()
    assert not [word for word in ("$ref", "anyOf", "oneOf", "allOf") if f'"{word}"' in text]


def test_a_member_that_may_be_missing_is_not_required():
    schema = json.loads(schema_of("fleet.GpsReport"))
    assert schema["required"] == ["stamp", "fix_type"]
    assert schema["properties"]["point"]["properties"]["latitude"] == {"type": "number"}


def test_an_unknown_schema_is_refused():
    with pytest.raises(KeyError):
        schema_of("foxglove.Nothing")
