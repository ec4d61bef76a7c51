"""JSON Schemas of recorded messages: Foxglove's, as published, and those of our own types."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from importlib import resources
from types import MappingProxyType
from typing import Any, get_args

import msgspec

from fleet.history.record import Record
from fleet.link.tap import LinkFrames
from fleet.missions.report import RunState
from fleet.model.description import RobotDescription
from fleet.model.report import Report
from fleet.model.schedule import ScheduleAnswer
from fleet.model.state import EdgeState, RobotState

FOXGLOVE = ("FrameTransform", "JointStates", "LocationFix", "Log", "PoseInFrame")
"""Foxglove's schemas in use, by name without ``foxglove.``."""
DOCUMENT = "fleet.Document"
"""Any JSON object."""
UNREAD = "fleet.Unread"
"""A sample that is no report: its bytes in base64."""

_OPEN: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        DOCUMENT: {"properties": {}},
        UNREAD: {"properties": {"data": {"type": "string", "contentEncoding": "base64"}}},
    }
)
_BESIDE_REPORTS = (
    RobotState,
    EdgeState,
    RobotDescription,
    ScheduleAnswer,
    RunState,
    Record,
    LinkFrames,
)
OWN: Mapping[str, type[msgspec.Struct]] = MappingProxyType(
    {f"fleet.{kind.__name__}": kind for kind in (*get_args(Report), *_BESIDE_REPORTS)}
)
"""Our own types, by the name of their schema."""
_SCALARS = frozenset({"string", "number", "integer", "boolean"})


@functools.cache
def schema_of(name: str) -> bytes:
    """Return the JSON Schema of this name; raises KeyError for an unknown one."""
    kind, _, short = name.partition(".")
    if kind == "foxglove" and short in FOXGLOVE:
        return resources.files(__name__).joinpath(f"{name}.json").read_bytes()
    schema = _OPEN[name] if name in _OPEN else _generated(OWN[name])
    return json.dumps({"title": name, "type": "object", **schema}).encode()


def _generated(kind: type[msgspec.Struct]) -> dict[str, Any]:
    """Return the schema of a type, in the subset of JSON Schema that Foxglove reads.

    The subset has neither references nor unions: references are expanded, nullable members are optional
    instead, and members of several types are left out.
    """
    schema = msgspec.json.schema(kind)
    definitions: Mapping[str, Any] = schema.get("$defs", {})
    found = _plain(schema, definitions) or {}
    return {name: found[name] for name in ("description", "properties", "required") if name in found}


def _plain(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return a schema without references and unions; None if it has no single type."""
    if "$ref" in schema:
        return _plain(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    choices = [each for each in schema.get("anyOf", ()) if each.get("type") != "null"]
    if choices:
        return _plain(choices[0], definitions) if len(choices) == 1 else None
    if schema.get("type") == "object":
        return _plain_object(schema, definitions)
    if schema.get("type") == "array":
        items = _plain(schema.get("items") or {}, definitions)
        return {"type": "array", "items": items} if items is not None else None
    return _plain_value(schema)


def _plain_value(schema: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the schema of a number, text or boolean; None if it has no single type."""
    if schema.get("type") in _SCALARS:
        return {name: schema[name] for name in ("type", "contentEncoding") if name in schema}
    words = [word for word in schema.get("enum", ()) if word is not None]
    if words and all(isinstance(word, str) for word in words):
        return {"type": "string", "enum": words}
    return None


def _plain_object(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of an object; members without a single type are left out."""
    plain = {name: _plain(each, definitions) for name, each in schema.get("properties", {}).items()}
    described = {name: each for name, each in plain.items() if each is not None}
    text = {"description": schema["description"]} if "description" in schema else {}
    given = schema.get("properties", {})
    required = [
        name
        for name in schema.get("required", ())
        if name in described and {"type": "null"} not in given[name].get("anyOf", ())
    ]
    return {"type": "object", **text, "properties": described, **({"required": required} if required else {})}
