"""Editors check mission files with the schema: it takes what fleet takes, and finds what is misspelt."""

import pathlib
import re

import pytest
import yaml

from fleet.config.json_schema import mission_file_schema
from fleet.config.yaml import read

EXAMPLES = sorted((pathlib.Path(__file__).parents[3] / "examples").glob("*.yaml"))
SCHEMA = mission_file_schema()
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "null": type(None),
}
MISSION = """
version: 1
inputs: {height: {type: number, max: 9}}
roles: {eye: {count: 2, can: [takeoff]}, feet: {count: {min: 1, max: 3}, spares: 1}}
occupies: [gate]
steps:
  - id: up
    do: {eye: {command: takeoff, with: {altitude: {input: height}}, timeout: 60 s}, feet: stand_up}
    undo: {all: land}
  - {id: go, start: together, do: {eye: {goto: [{input: height}, 2]}, feet: {path: way.yaml, retry: 1}}}
  - {id: rest, wait: 1 min}
  - {id: again, repeat: {times: 2, until: {role: eye, battery: {max: 4}}, steps: [{id: x, ask: {text: Eh}}]}}
"""


def fits(value, schema):
    """Return whether a value is as a schema says; as much of JSON Schema as this one uses."""
    if "$ref" in schema:
        return fits(value, SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]])
    wrong = (
        "anyOf" in schema and not any(fits(value, each) for each in schema["anyOf"]),
        "const" in schema and value != schema["const"],
        "enum" in schema and value not in schema["enum"],
        "type" in schema and not isinstance(value, TYPES[schema["type"]]),
        isinstance(value, str) and not re.search(schema.get("pattern", ""), value),
    )
    if any(wrong):
        return False
    if isinstance(value, list):
        return all(fits(each, schema.get("items", {})) for each in value)
    return _members_fit(value, schema) if isinstance(value, dict) else True


def _members_fit(value, schema):
    properties, more = schema.get("properties", {}), schema.get("additionalProperties", True)
    patterns = schema.get("patternProperties", {})
    if not set(schema.get("required", ())) <= value.keys():
        return False
    for key, each in value.items():
        found = properties.get(key) or next(
            (part for pattern, part in patterns.items() if re.search(pattern, key)), more
        )
        if found is False or (isinstance(found, dict) and not fits(each, found)):
            return False
    return True


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_fits(path):
    assert fits(read(path, {}).data, SCHEMA)


def test_short_forms_inputs_durations_and_files_fit():
    assert fits(yaml.safe_load(MISSION), SCHEMA)


@pytest.mark.parametrize(
    ("of", "instead"),
    [
        ("occupies:", "ocupies:"),
        ("steps:\n", "stepps:\n"),
        ("timeout: 60 s", "timeout: soon"),
        ("command: takeoff", "comand: takeoff"),
        ("start: together", "start: later"),
        ("count: 2", "count: two"),
        ("version: 1", "version: 2"),
        ("{text: Eh}", "{txt: Eh}"),
    ],
)
def test_what_is_misspelt_does_not(of, instead):
    assert of in MISSION
    assert not fits(yaml.safe_load(MISSION.replace(of, instead)), SCHEMA)
